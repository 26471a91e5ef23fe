"""The command among closed streams, full disks, odd settings, killed runs and ^C."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import copose
from cells import planar
from copose.commands.command_line import main
from copose.results import to_json, write_file
from reference import PROBLEMS

FIGURE = PROBLEMS / "paper-fig2.toml"
COPOSE = f"{sys.executable} -m copose"


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shell(line: str, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        line, shell=True, executable="/bin/bash", capture_output=True, text=True, check=False,
        env=os.environ | environment, timeout=120,
    )  # fmt: skip


def test_pictures_have_no_settings_but_ours(here: Path) -> None:
    """A notebook's backend that is not installed, TeX and fonts that are missing, no cache."""
    solution = copose.solve(copose.load(PROBLEMS / "two-panda-box.toml"), effort="low")
    (here / "r.json").write_text(to_json(solution))
    assert main(["compare", "r.json", "r.json", "--quiet", "--figure", "plain.png"]) == 0
    (here / "matplotlibrc").write_text(
        "text.usetex: True\nfont.family: Nothing\naxes.facecolor: red\nno.such.key: 1\n"
    )
    answer = shell(
        f"{COPOSE} compare r.json r.json --figure odd.png <&- >&-",
        MPLBACKEND="not-installed", MPLCONFIGDIR="/proc/none", HOME="/proc/none",
    )  # fmt: skip
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")
    assert (here / "plain.png").read_bytes() == (here / "odd.png").read_bytes()


def test_a_picture_leaves_a_users_settings_alone(here: Path) -> None:
    import matplotlib

    solution = copose.evaluate(copose.load(FIGURE))
    with matplotlib.rc_context({"axes.facecolor": "red", "backend": "svg"}):
        copose.draw(solution, "ours.png")
        assert matplotlib.rcParams["axes.facecolor"] == "red"
        assert matplotlib.rcParams["backend"] == "svg"
    copose.draw(solution, "again.png")
    assert (here / "ours.png").read_bytes() == (here / "again.png").read_bytes()


def test_names_are_no_markup(here: Path) -> None:
    cell = planar(name="$_{1$ [red]<b>")
    cell["arms"][0]["name"] = "$a_1^"
    copose.draw(copose.solve(copose.parse(cell), effort="low"), "names.svg")
    words = (here / "names.svg").read_text()
    assert "$_{1$ [red]&lt;b&gt;" in words and "arm $a_1^" in words


@pytest.mark.parametrize("how", ["disk", "drawing"])
def test_a_picture_that_fails_costs_a_line(how: str, here: Path, monkeypatch, capsys) -> None:
    """The result is there before it is drawn, and an earlier picture is not."""
    import copose.report

    (here / "out").mkdir()
    for name in ("before_after.png", "path.png", "trajectory.csv", "mine.png"):
        (here / "out" / name).write_text("of an earlier run")

    def fail(*_: object) -> bytes:
        names = sorted(path.name for path in (here / "out").iterdir())
        assert names == ["mine.png", "result.json"]
        raise RuntimeError("no\nfont") if how == "drawing" else copose.InputError("is full")

    monkeypatch.setattr(copose.report, "picture", fail)
    assert main(["evaluate", str(FIGURE), "--quiet", "-o", "out"]) == 0
    expected = {
        "drawing": "copose: warning: out/before_after.png: RuntimeError: no font\n",
        "disk": "copose: warning: is full\n",
    }
    assert capsys.readouterr().err == expected[how]
    assert json.loads((here / "out/result.json").read_text())["status"] == "solved"


@pytest.mark.parametrize("streams", [">&-", ">/dev/full", ">/dev/full 2>/dev/full"])
def test_streams_that_cannot_be_written_to(streams: str) -> None:
    answer = shell(f"{COPOSE} --help {streams}")
    assert answer.returncode == (0 if streams == ">&-" else 2)
    full = "copose: cannot print: No space left on device\n"
    assert answer.stderr == (full if streams == ">/dev/full" else "")


@pytest.mark.parametrize("streams", ["<&-", ">&-", "2>&-", "<&- 2>&-", "<&- >&- 2>&-"])
def test_no_file_takes_the_place_of_a_closed_stream(streams: str, here: Path) -> None:
    opening = (
        "import os, sys, copose.__main__ as command; command._open_streams(); "
        "file = open('told', 'w'); print(file.fileno(), file=file); "
        "print(sys.stdin.fileno(), end=''); print('x', file=sys.stderr)"
    )
    answer = shell(f'{sys.executable} -c "{opening}" {streams}')
    assert answer.returncode == 0 and int((here / "told").read_text()) > 2
    assert answer.stdout == ("" if ">&- " in f"{streams} ".replace("2>", "") else "0")


@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full", "2>&1 | true"])
def test_mistakes_keep_their_status_where_nobody_listens(streams: str) -> None:
    answer = shell(f"{COPOSE} nothing {streams}; exit ${{PIPESTATUS[0]}}")
    assert (answer.returncode, answer.stdout, answer.stderr) == (2, "", "")


@pytest.mark.parametrize("arguments", [f"check {FIGURE}", "--help"])
def test_a_reader_that_has_gone_is_141(arguments: str) -> None:
    answer = shell(f"{{ sleep 0.2; {COPOSE} {arguments}; }} | true; exit ${{PIPESTATUS[0]}}")
    assert (answer.returncode, answer.stdout, answer.stderr) == (141, "", "")


@pytest.mark.parametrize("columns", ["0", "1", "10", "x"])
def test_tables_on_narrow_terminals_lose_nothing(columns: str, monkeypatch, capsys) -> None:
    monkeypatch.setenv("TERM", "dumb")
    said = []
    for width in ("80", columns):
        monkeypatch.setenv("COLUMNS", width)
        assert main(["check", str(FIGURE)]) == 0
        assert main(["--help"]) == 0
        said.append(capsys.readouterr().out.partition("usage:")[0])
    assert said[0] == said[1] and re.search("1 +│ revolute │ +none", said[0])


def test_a_folder_that_was_removed_and_no_home(here: Path) -> None:
    gone = f"mkdir gone && cd gone && rmdir ../gone && env -u HOME {COPOSE}"
    answer = shell(f"{gone} evaluate {FIGURE} -o out")
    assert (answer.returncode, answer.stdout) == (2, "")
    words = "copose: out/result.json: cannot be written: No such file or directory\n"
    assert answer.stderr == words


def test_what_nobody_has_foreseen_is_a_line() -> None:
    for error, words in (
        ("MemoryError", "out of memory"),
        ("ZeroDivisionError('a\\nb' * 1000)", "internal error: ZeroDivisionError: a ba b"),
    ):
        broken = (
            "import sys, copose.commands.command_line, copose.__main__\n"
            f"def main(**_): raise {error}\n"
            "copose.commands.command_line.main = main\n"
            "sys.exit(copose.__main__.run())"
        )
        quiet, loud = (
            subprocess.run(
                [sys.executable, "-c", broken], capture_output=True, text=True, check=False,
                env=os.environ | {"COPOSE_DEBUG": debug},
            )
            for debug in ("", "1")
        )  # fmt: skip
        assert quiet.returncode == loud.returncode == 4
        assert quiet.stderr.startswith(f"copose: {words}") and "COPOSE_DEBUG=1" in quiet.stderr
        assert quiet.stderr.count("\n") == 1 and len(quiet.stderr) <= 600
        assert "Traceback" in loud.stderr


# Says when the command heeds ^C: how long an interpreter takes to start differs.
READY = (
    "import sys, copose.__main__ as command; opened = command._open_streams; "
    "command._open_streams = lambda: (opened(), print('ready', flush=True)); "
    "sys.exit(command.run())"
)


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.9])
def test_an_interrupt_is_a_line_and_130(delay: float, here: Path) -> None:
    """From the first line of the command on, in imports and in native code."""
    command = [sys.executable, "-c", READY, "solve", str(PROBLEMS / "two-panda-box.toml")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
    assert (process.returncode, out) == (130, "")
    # A quick machine may have found something, or be at the pictures of its answer.
    told = re.fullmatch("copose: interrupted(: the (best so far|answer) is in (.*))?\n", err)
    assert told and (told[3] is None or Path(told[3]).is_file())


def test_an_interrupt_of_the_drawing_tells_where_the_answer_is(here: Path) -> None:
    struck = (
        "import signal, sys, copose.__main__, copose.report as report; "
        "report.picture = lambda *_: signal.raise_signal(signal.SIGINT); "
        "sys.exit(copose.__main__.run())"
    )
    command = [sys.executable, "-c", struck, "solve", str(PROBLEMS / "paper-fig2.toml")]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    file = Path("paper-fig2/result.json")
    assert (process.returncode, process.stdout) == (130, "")
    assert process.stderr == f"copose: interrupted: the answer is in {file}\n"
    assert copose.read_solution(file).status == "solved"


@pytest.mark.parametrize(("trap", "status"), [("trap - INT", 130), ("trap '' INT", 0)])
def test_a_background_job_that_ignores_interrupts_goes_on(trap: str, status: int) -> None:
    struck = (
        "import signal, sys, copose.commands.command_line, copose.__main__; "
        "copose.commands.command_line.main = lambda **_: signal.raise_signal(signal.SIGINT) or 0; "
        "sys.exit(copose.__main__.run())"
    )
    assert shell(f'{trap}; {sys.executable} -c "{struck}"').returncode == status


def test_what_a_killed_run_left_is_swept_by_the_next(here: Path) -> None:
    killed = (
        "import os, signal; from pathlib import Path; from copose.results import write_file\n"
        "Path.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "write_file(Path('result.json'), b'half')"
    )
    answer = subprocess.run([sys.executable, "-c", killed], check=False)
    assert answer.returncode == -signal.SIGKILL
    (left,) = here.iterdir()
    assert left.name.startswith(".result.json.")
    (here / ".result.json.mine").touch()
    write_file(here / "path.png", b"whole")
    assert sorted(path.name for path in here.iterdir()) == [".result.json.mine", "path.png"]


def test_what_others_write_is_not_swept(here: Path, monkeypatch) -> None:
    """One writes while another begins."""
    writing, go_on = threading.Event(), threading.Event()
    waiting = os.fsync

    def fsync(handle: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            writing.set()
            assert go_on.wait(20)
        waiting(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    other = threading.Thread(target=write_file, args=(here / "a", b"a"))
    other.start()
    assert writing.wait(20)
    write_file(here / "b", b"b")
    go_on.set()
    other.join()
    assert {path.name: path.read_bytes() for path in here.iterdir()} == {"a": b"a", "b": b"b"}


def test_what_is_no_file_is_written_to_as_it_is(here: Path) -> None:
    pipe, read = here / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_file(pipe, b"whole")
    reader.join(10)
    assert read == [b"whole"] and not pipe.is_file() and list(here.iterdir()) == [pipe]
    with pytest.raises(copose.InputError, match="No space left"):
        write_file(Path("/dev/full"), b"whole")
    assert not Path("/dev/full").is_file()
