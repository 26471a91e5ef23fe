"""The command: exit status, what it writes, what it prints, and what it leaves behind."""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import shlex
import stat
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import copose
import path_problems
from cells import FILES, flat_arm, planar, tables, toml
from copose.commands.command_line import command_parser, main
from reference import PROBLEMS


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder: Path, cell: dict, name: str = "p.toml") -> str:
    (folder / name).write_text(toml(cell))
    return name


def out_of_reach() -> dict:
    cell = planar()
    cell["arms"][1]["base"]["position"] = [3.0, 0.1]
    return cell


def test_solve_writes_a_result_and_a_picture(here: Path, capsys) -> None:
    assert main(["solve", write(here, planar(name="my cell"))]) == 0
    assert sorted(path.name for path in (here / "my cell").iterdir()) == [
        "before_after.png",
        "result.json",
    ]
    result = json.loads((here / "my cell/result.json").read_text())
    assert list(result)[:10] == [
        "format", "copose", "problem", "status", "reason", "notes", "objective", "joint_names",
        "before", "after",
    ]  # fmt: skip
    assert result["copose"] == copose.__version__ and result["status"] == "solved"
    assert result["after"]["object"] == {"position": [0.0, 0.1], "angle": 0.0}
    out, err = capsys.readouterr()
    assert "area ×" in out and "local optima" in out and "closure error" in out and err == ""
    mode = stat.S_IMODE((here / "my cell/result.json").stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    assert mode == 0o666 & ~umask


def test_spatial_results_have_a_quaternion(here: Path) -> None:
    cell = tables("two-panda-box")
    cell["object"]["rpy"] = [0.0, 0.0, 0.2]
    assert main(["solve", write(here, cell), "-o", "out", "--quiet"]) == 0
    place = json.loads((here / "out/result.json").read_text())["after"]["object"]
    assert set(place) == {"position", "quaternion"}
    assert place["quaternion"] == pytest.approx([0.995004165278, 0, 0, 0.0998334166468], abs=1e-12)


def test_json_is_the_result_and_nothing_else(here: Path, capsys) -> None:
    assert main(["solve", write(here, planar()), "--json"]) == 0
    out, err = capsys.readouterr()
    assert out == (here / "cell/result.json").read_text() and err == ""


def test_quiet_prints_nothing(here: Path, capsys) -> None:
    assert main(["solve", write(here, planar()), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_seed_takes_the_place_of_the_files(here: Path) -> None:
    file = write(here, planar(search={"seed": 5}))
    main(["solve", file, "--quiet", "-o", "a"])
    main(["solve", file, "--quiet", "-o", "b", "--seed", "7"])
    seeds = [json.loads((here / d / "result.json").read_text())["search"]["seed"] for d in "ab"]
    assert seeds == [5, 7]


def test_infeasible_is_three_with_a_result_and_no_picture(here: Path, capsys) -> None:
    assert main(["solve", write(here, planar()), "-o", "out", "--quiet"]) == 0
    assert main(["solve", write(here, out_of_reach()), "-o", "out"]) == 3
    assert [path.name for path in (here / "out").iterdir()] == ["result.json"]
    result = json.loads((here / "out/result.json").read_text())
    assert result["status"] == "infeasible" and result["after"] is None
    assert "arm 'a2' cannot reach its grasp" in result["reason"]
    assert "arm 'a2' cannot reach its grasp" in " ".join(capsys.readouterr().out.split())


def test_infeasible_draws_the_nearest_miss_where_asked(here: Path, capsys) -> None:
    arguments = ["solve", write(here, out_of_reach()), "--quiet", "--figure", "miss.png"]
    assert main(arguments) == 3
    assert (here / "miss.png").read_bytes().startswith(b"\x89PNG")
    assert "a2" in capsys.readouterr().err


def test_failed_is_four(here: Path) -> None:
    assert main(["solve", write(here, flat_arm(here)), "--quiet"]) == 4
    assert json.loads((here / "flat/result.json").read_text())["status"] == "failed"
    assert not (here / "flat/before_after.png").exists()


def test_evaluate_the_start_and_a_result(here: Path, capsys) -> None:
    file = write(here, tables("paper-fig3"))
    assert main(["evaluate", file, "-o", "start"]) == 0
    start = json.loads((here / "start/result.json").read_text())
    assert start["before"] is None and start["objective"]["before"] is None
    assert (here / "start/before_after.png").exists()
    assert main(["solve", file, "-o", "best", "--quiet"]) == 0
    assert main(["evaluate", file, "--joints", "best/result.json", "-o", "again", "--quiet"]) == 0
    best, again = (json.loads((here / d / "result.json").read_text()) for d in ("best", "again"))
    assert best["after"] == {key: again["after"][key] for key in best["after"]}
    assert best["objective"]["after"] == again["objective"]["after"]
    assert "posture" in capsys.readouterr().out


def test_evaluate_of_an_open_chain_is_three(here: Path, capsys) -> None:
    cell = tables("paper-fig3")
    cell["arms"][0]["start"][1] += 0.01
    assert main(["evaluate", write(here, cell), "--quiet"]) == 3
    assert "'a1' misses its grasp by" in capsys.readouterr().err


def test_compare_two_results(here: Path, capsys) -> None:
    for name, kind in (("a", "volume"), ("b", "isotropy")):
        file = write(here, planar(objective={"kind": kind}), f"{name}.toml")
        assert main(["solve", file, "-o", name, "--quiet"]) == 0
    assert main(["compare", "a/result.json", "b/result.json"]) == 0
    out = capsys.readouterr().out
    a, b = (json.loads((here / f"{name}/result.json").read_text())["after"] for name in "ab")
    difference = math.remainder(b["joints"]["a2"][1] - a["joints"]["a2"][1], 2 * math.pi)
    assert f"{difference:+.4f}" in out and "isotropy" in out and "torque-optimal" in out
    assert f"{a['ellipsoid']['log_volume']:.6f}" in out
    assert (here / "compare.png").read_bytes().startswith(b"\x89PNG")
    assert main(["compare", "a/result.json", "a/result.json", "--quiet", "--figure", "s.svg"]) == 0
    assert capsys.readouterr().out == "" and (here / "s.svg").exists()


AIMS = {
    "all": {},
    "slice": {"objective": {"kind": "volume", "axes": ["x", "y", "z"]}},
    "turn": {"objective": {"kind": "volume", "axes": ["roll", "yaw"]}},
    "limits": {"ellipsoid": {"torque_scaling": "limits"}},
}


@cache
def aimed(name: str) -> str:
    solution = copose.solve(copose.parse(tables("two-panda-box") | AIMS[name]))
    return copose.results.to_json(solution)


@pytest.mark.few(5)
@pytest.mark.parametrize("pair", list(itertools.permutations(AIMS, 2)), ids="-".join)
def test_compare_results_with_other_axes_and_scalings(pair: tuple, here: Path, capsys) -> None:
    for name in pair:
        (here / f"{name}.json").write_text(aimed(name))
    assert main(["compare", *(f"{name}.json" for name in pair)]) == 0
    out = capsys.readouterr().out
    if "slice" in pair and "turn" not in pair:
        assert "x y z" in out and "–" in out
    assert (here / "compare.png").stat().st_size > 10_000


def test_compare_counts_no_whole_turns(here: Path, capsys) -> None:
    from copose.results import to_json

    solution = copose.solve(copose.parse(planar()))
    answer = json.loads(to_json(solution))
    assert answer["unlimited"]["a1"] == ["joint1", "joint2", "joint3"]
    (here / "a.json").write_text(json.dumps(answer))
    answer["after"]["joints"]["a1"][0] += 6.0
    (here / "b.json").write_text(json.dumps(answer))
    assert main(["compare", "a.json", "b.json"]) == 0
    assert f"{6.0 - 2 * 3.141592653589793:+.4f}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        (("after", "joints", "a1"), [1.0], "joints: not those that joint_names lists"),
        (("after", "ellipsoid", "radii"), [0.0, 0.0], "not one positive number per axis"),
        (("problem", "axes"), ["q", "y"], "not coordinates of the task space"),
        (("after", "ellipsoid", "gram"), "x", "after.ellipsoid.gram"),
    ],
)
def test_damaged_results_are_refused(path, value, expected, here: Path, capsys) -> None:
    from copose.results import to_json

    answer = json.loads(to_json(copose.solve(copose.parse(planar()))))
    (here / "a.json").write_text(json.dumps(answer))
    node = answer
    for part in path[:-1]:
        node = node[part]
    node[path[-1]] = value
    (here / "b.json").write_text(json.dumps(answer))
    assert main(["compare", "a.json", "b.json"]) == 2
    err = capsys.readouterr().err
    assert "b.json: is no copose result" in err and expected in err and err.count("\n") == 1


def test_check_prints_the_chains(here: Path, capsys) -> None:
    file = next(f for f in FILES if f.stem == "two-panda-box")
    assert main(["check", str(file)]) == 0
    out = capsys.readouterr().out
    assert "left: panda_joint*" in out
    places = [re.search(rf"^  {i} +│ revolute", out, re.M).start() for i in range(1, 8)]
    assert places == sorted(places)
    for text in ("-2.8973", "87", "2.175", "panda_finger_joint1 = 0", "gears are ignored"):
        assert text in out
    assert not list(here.iterdir())


def test_check_tells_the_way_of_the_object(here: Path, capsys) -> None:
    cell = path_problems.hinged(duration=2.0)
    (here / "way.toml").write_text(toml(cell))
    assert main(["check", "way.toml"]) == 0
    said = capsys.readouterr().out
    assert "path: 2 waypoints, 0.269 m and 0.5 rad in 2 s, 0.252 m/s at most; 25 knots" in said


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"duration": "shortest"}, "path.duration: needs limits that take time to keep"),
        ({"closed": True}, "path.closed: a closed path ends where it begins"),
    ],
)
def test_check_refuses_what_path_refuses(here: Path, capsys, keys: dict, words: str) -> None:
    (here / "way.toml").write_text(toml(path_problems.hinged(**keys)))
    assert main(["check", "way.toml"]) == 2
    assert words in capsys.readouterr().err


WRONG = [
    (["solve"], "the following arguments are required: PROBLEM.toml"),
    (["sove", "p.toml"], "invalid choice: 'sove'"),
    ([], "the following arguments are required: COMMAND"),
    (["solve", "p.toml", "--seed", "x"], "argument --seed"),
    (["solve", "p.toml", "--seed", "-1"], "argument --seed"),
    (["solve", "p.toml", "--nonsense"], "unrecognized arguments: --nonsense"),
    (["solve", "nope.toml"], "nope.toml: no such file"),
    (["solve", "."], "is a folder"),
    (["solve", "p.toml", "-o", "p.toml"], "p.toml: is a file; a folder was expected"),
    (["solve", "p.toml", "-o", "p.toml/x"], "is a file; a folder was expected"),
    (["solve", "p.toml", "--figure", "x.jpg"], "x.jpg: .jpg: a picture ends in .png, .pdf, .svg"),
    (["solve", "p.toml", "--figure", "d.png"], "d.png: is a folder"),
    (["solve", "p.toml", "--figure", "f" * 300 + ".png"], "cannot be written: File name too long"),
    (["solve", "p.toml", "-o", "full"], "result.json: is a folder"),
    (["evaluate", "p.toml"], "arms[0] (a1).start: missing"),
    (["evaluate", "p.toml", "--joints", "nope.json"], "nope.json: no such file"),
    (["evaluate", "p.toml", "--joints", "p.toml"], "is no copose result"),
    (["evaluate", "p.toml", "--joints", "miss.json"], "miss.json: after: has no posture"),
    (["evaluate", "p.toml", "--joints", "other.json"], "other.json: joints: no arm is called"),
    (["compare", "miss.json", "other.json"], "miss.json: after: has no posture"),
    (["compare", "two.json", "other.json"], "other.json: joint_names: is not that of two.json"),
    (["compare", "two.json", "nope.json"], "nope.json: no such file"),
    (["compare", "two.json"], "the following arguments are required: B.json"),
    (["check", "q.toml"], "q.toml: object.mass: -1 must be above zero"),
]


@cache
def answers() -> dict[str, str]:
    cells = {"miss.json": out_of_reach(), "other.json": planar(3), "two.json": planar()}
    return {name: copose.results.to_json(copose.solve(copose.parse(cell)))
            for name, cell in cells.items()}  # fmt: skip


@pytest.mark.parametrize(("arguments", "expected"), WRONG, ids=lambda x: " ".join(x)[:30])
def test_wrong_input_is_two_in_one_line_and_leaves_nothing(
    arguments: list[str], expected: str, here: Path, capsys
) -> None:
    write(here, planar())
    bad = planar()
    bad["object"]["mass"] = -1
    write(here, bad, "q.toml")
    (here / "d.png").mkdir()
    (here / "full/result.json").mkdir(parents=True)
    for name, text in answers().items():
        (here / name).write_text(text)
    before = sorted(here.rglob("*"))
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert expected in err and err.count("\n") == 1 and len(err) <= 600 and out == ""
    assert sorted(here.rglob("*")) == before


def test_a_file_that_cannot_be_written_leaves_nothing_beside_it(here: Path) -> None:
    from copose.results import write_file

    (here / "out/result.json/x").mkdir(parents=True)
    with pytest.raises(copose.InputError, match=r"result\.json: cannot be written"):
        write_file(here / "out/result.json", b"{}")
    assert [path.name for path in (here / "out").iterdir()] == ["result.json"]


def test_a_full_disk_is_told(here: Path) -> None:
    write(here, planar())
    answer = subprocess.run(
        f"{sys.executable} -m copose solve p.toml > /dev/full",
        shell=True, cwd=here, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert answer.returncode == 2
    assert answer.stderr == "copose: cannot print: No space left on device\n"


def test_nothing_leaks_to_stderr(here: Path) -> None:
    """CasADi's warnings on a singular start."""
    cell = planar(1, 3)
    cell["object"]["position"] = [1.2, 0.0]
    cell["arms"][0].update(
        base={"position": [0, 0]}, grasp={"position": [0, 0]}, start=[0.0, 0.0, 0.0],
        position_limits=[[-0.5, 0.5]] * 3,
    )  # fmt: skip
    write(here, cell)
    answer = run("solve", "p.toml", cwd=here)
    assert answer.stderr == (
        "copose: failed: volume 0: the Jacobian of arm 'a1' has rank 1 of 2 here; another posture, "
        "or [objective] axes that it can move along, has a volume\n"
    )


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_figures_are_the_same_every_time(kind: str, here: Path) -> None:
    file = write(here, planar())
    for name in ("one", "two"):
        assert main(["solve", file, "--quiet", "--figure", f"{name}.{kind}"]) == 0
    one, two = ((here / f"{name}.{kind}").read_bytes() for name in ("one", "two"))
    magic = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind]
    assert one == two and one.startswith(magic)


def run(*arguments: str, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "copose", *arguments],
        capture_output=True, text=True, timeout=120, check=False, **options,
    )  # fmt: skip


def test_import_loads_nothing_heavy() -> None:
    code = (
        "import sys, copose; "
        "print([m for m in ('casadi', 'numpy', 'pinocchio', 'scipy') if m in sys.modules])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "[]"


def test_public_names_exist() -> None:
    for name in copose.__all__:
        assert getattr(copose, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        copose.nothing  # noqa: B018


def test_a_solution_waits_for_nothing_that_it_does_not_need(here: Path) -> None:
    """Neither for drawings, tables and studies, nor for what moves the object, maps self-motions,
    walks them, slices them, measures misses, proves, reads robots, solves programs, or tells
    distances of bodies that are round.
    """
    write(here, planar())
    rooms = ("studies", "motion", "posture.landscape", "posture.placement.search",
             "posture.reachable.search", "self_motion.misses", "objectives.all_round",
             "self_motion.slices", "proof.proof", "posture.inspection", "posture.run.certificate",
             "posture.solvers.nlp", "robots.files.tree", "collision.links.robot_links",
             "report.text")  # fmt: skip
    libraries = ("matplotlib", "scipy", "pinocchio", "coal", "rich", "numpy.ma")
    names = [*libraries, *(f"copose.{room}" for room in rooms)]
    code = (
        "import sys; from copose.commands.command_line import main\n"
        "import copose.commands.posture as posture\n"
        "posture.write_answer = lambda *given: None\n"
        "main(['solve', 'p.toml', '--quiet'])\n"
        f"print([m for m in {names} if m in sys.modules])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.splitlines()[-1] == "[]"


def test_a_process_on_its_way_out_looks_for_no_garbage() -> None:
    code = "import gc; from copose.__main__ import run; run(); print(gc.get_freeze_count() > 1000)"
    answer = subprocess.run(
        [sys.executable, "-c", code, "--version"], capture_output=True, text=True, check=True
    )
    assert answer.stdout.splitlines()[-1] == "True"


def test_planar_problems_do_not_wait_for_pinocchio(here: Path) -> None:
    write(here, planar())
    code = (
        "import sys, copose; copose.solve(copose.load('p.toml')); "
        "print('pinocchio' in sys.modules, 'matplotlib' in sys.modules)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.split() == ["False", "False"]


def test_the_command_in_a_pipe(here: Path) -> None:
    write(here, planar())
    answer = run("solve", "p.toml", cwd=here, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert answer.returncode == 0 and answer.stderr == "" and "\x1b" not in answer.stdout
    assert run("--version").stdout == f"copose {copose.__version__}\n"
    assert "solve" in run("--help").stdout
    wrong = run("solve", "nope.toml")
    assert wrong.returncode == 2 and wrong.stderr == "copose: nope.toml: no such file\n"


def test_a_reader_that_goes_away_is_no_error(here: Path) -> None:
    write(here, planar())
    shell = f"{sys.executable} -m copose solve p.toml --json | head -c 1"
    answer = subprocess.run(shell, shell=True, cwd=here, capture_output=True, text=True, check=True)
    assert answer.stdout == "{" and answer.stderr == ""


def test_progress_on_a_terminal_only(here: Path) -> None:
    import pty

    write(here, planar())
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "copose", "solve", "p.toml"], cwd=here, stderr=follower,
        stdout=subprocess.DEVNULL, env=os.environ | {"TERM": "xterm"},
    )  # fmt: skip
    os.close(follower)
    seen = b""
    while True:
        try:
            chunk = os.read(leader, 4096)
        except OSError:
            break
        if not chunk:
            break
        seen += chunk
    os.close(leader)
    assert process.wait(timeout=60) == 0
    assert b"polishing" in seen and b"\x1b" in seen


def test_every_help_ends_in_an_example_that_is_right(capsys) -> None:
    assert main(["--help"]) == 0
    listed = capsys.readouterr().out.partition("COMMAND\n")[2]
    commands = re.findall(r"^    (\w+)", listed, re.M)
    assert {"init", "solve", "export", "check", "manual", "schema"} <= {*commands}
    for command in commands:
        assert main([command, "--help"]) == 0
        said, example = capsys.readouterr().out.rstrip().rsplit("\n", 1)
        assert said.endswith("\nexample:")
        words = shlex.split(example.partition(" > ")[0])
        assert words[:2] == ["copose", command]
        command_parser().parse_args(words[1:])
        for word in words[2:]:
            assert not word.startswith("problems/") or (PROBLEMS.parent / word).is_file()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("ev", {"evaluate"}),
        ("solve --eff", {"--effort"}),
        ("export r.json --to m", {"moveit", "mujoco"}),
        ("manual pro", {"problem-files", "proof"}),
        ("check cel", {"cell.toml"}),
        ("solve cell.toml --effort ", {"low", "normal", "high"}),
    ],
)
def test_shells_complete(here: Path, line: str, told: set[str]) -> None:
    (here / "cell.toml").touch()
    line = f"copose {line}"
    asked = {
        "_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_STDOUT_FILENAME": "told",
    }  # fmt: skip
    answer = run(env=os.environ | asked)
    assert (answer.stdout, answer.stderr) == ("", "")
    found = {word.strip() for word in (here / "told").read_text().split("\n")} - {""}
    assert found == told
