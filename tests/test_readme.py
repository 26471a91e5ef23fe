"""README and manual are true: every block in them is run, and what they name is there.

Behind the language of a block stands what is done with it. A `toml` block is a file of the name
given, or goes `into` a problem, whose tables it extends. Commands and Python of a page share a
folder. What would need a network or files that are not here is only `parsed`.
"""

from __future__ import annotations

import ast
import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import copose
from copose.batch import check_study
from copose.commands.command_line import main
from copose.manual import page, topics
from copose.motion import described
from copose.posture.inspection import check
from copose.problem import RobotArm, is_study
from copose.studies import Study
from copose.studies.study_file import StudyFile
from reference import PROBLEMS

ROOT = PROBLEMS.parent
SOURCE = ROOT / "src/copose"
README = (ROOT / "README.md").read_text()
PAGES = {"README": README} | {topic: page(topic) for topic in topics()}


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the words behind it, and what is in it."""

    language: str
    words: str
    text: str


BLOCKS = {
    name: [
        Block(*found)
        for found in re.findall(r"^```(\w+)(?: ([^\n]*))?\n(.*?)^```$", text, re.M | re.S)
    ]
    for name, text in PAGES.items()
}


def blocks(language: str, name: str = "README") -> list[str]:
    return [block.text for block in BLOCKS[name] if block.language == language]


def pictures(name: str) -> list[Path]:
    folder = ROOT if name == "README" else SOURCE / "manual"
    return [folder / file for file in re.findall(r"!\[.*\]\((.*)\)", PAGES[name])]


def same_picture(shown: Path, drawn: Path) -> None:
    one, other = imread(shown), imread(drawn)
    assert one.shape == other.shape and np.abs(one - other).mean() < 0.01


@pytest.fixture
def here(tmp_path: Path, monkeypatch) -> Path:
    (tmp_path / "problems").symlink_to(PROBLEMS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shell(text: str) -> str:
    """Run a block with the commands of this environment; what it installs is installed."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    answer = subprocess.run(
        re.sub(r"^pip install \S+ && ", "", text, flags=re.M), shell=True, text=True,
        capture_output=True, check=False, timeout=300, env=os.environ | {"PATH": path},
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def test_every_block_is_of_a_kind_that_is_run() -> None:
    kinds = [block.language for block in BLOCKS["README"]]
    assert kinds == ["sh", "text", "sh", "text", "sh", "python", "sh"]
    assert {block.language for name in topics() for block in BLOCKS[name]} == {*RUNNERS}


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    folder = ROOT if name == "README" else SOURCE / "manual"
    for target in re.findall(r"\]\(([^)#]+)\)", PAGES[name]):
        assert (folder / target).exists(), target


def test_the_readme_lists_the_manual_and_is_short() -> None:
    listed = "\n".join(re.findall(r"^(?:-| ) .*", README, re.M))
    assert re.findall(r"\[([\w-]+)\]\(src/copose/manual/\1\.md\)", listed) == list(topics())
    assert len(README.splitlines()) <= 200 and len(README.split()) <= 1500


def test_the_manual_is_printed(capsys) -> None:
    assert main(["manual"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(topics())
    assert all(
        title and title in line for title, line in zip(topics().values(), listed, strict=True)
    )
    assert {*topics()} == {file.stem for file in (SOURCE / "manual").glob("*.md")}
    assert main(["manual", "paths"]) == 0
    assert "minimum-jerk" in capsys.readouterr().out
    for topic in ("robots", "commands", "problem-files"):
        assert main(["manual", topic]) == 0
        assert not re.search(r"\w…", capsys.readouterr().out), "a word of a table is cut off"
    assert main(["manual", "path"]) == 2
    told = "copose: TOPIC: no topic is called 'path'; did you mean 'paths'?"
    assert capsys.readouterr().err.startswith(told)


def test_the_first_command_prints_and_draws_what_is_shown(here: Path) -> None:
    printed = shell(blocks("sh")[0])

    def lasting(text: str) -> list[str]:
        return [line for line in text.splitlines() if "closure error" not in line]

    assert lasting(printed) == lasting(blocks("text")[0])
    same_picture(pictures("README")[0], here / "paper-fig2/before_after.png")


def test_from_two_robots_to_a_picture_in_three_commands(here: Path) -> None:
    printed = shell(blocks("sh")[1])
    assert printed.startswith(blocks("text")[1])
    assert "'left' holds the object" in printed
    assert re.search("volume ×[0-9.]+", printed).group() in README
    assert (here / "cell.png").exists() and (here / "cell/before_after.png").exists()
    shell(blocks("sh")[2])
    assert (here / "two.png").exists() and (here / "carried/trajectory.yaml").exists()
    for folder in ("lift", "payload", "clear", "told"):
        assert copose.read_solution(f"{folder}/result.json").status == "solved"


def test_the_test_command_is_what_ci_runs() -> None:
    command = blocks("sh")[3].strip()
    assert command == (ROOT / ".ci/run").read_text().splitlines()[-1]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "test" in extras["optional-dependencies"] and "robots" in extras["optional-dependencies"]


def test_the_remarks_are_what_the_benchmark_counts() -> None:
    answer = subprocess.run(
        [sys.executable, ROOT / "benchmarks/paper_remarks.py"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert answer.stdout in PAGES["paper"]


def test_the_python_of_the_readme_runs(here: Path, capsys) -> None:
    exec(compile(blocks("python")[0], "README", "exec"), {})
    assert "2.727" in capsys.readouterr().out and (here / "before_after.svg").exists()


def run_line(line: str) -> None:
    assert line.startswith("copose "), line
    assert main(shlex.split(line)[1:]) == 0, line


def check_line(line: str) -> None:
    """A line that installs an extra that is there, or runs a script that is."""
    words = shlex.split(line)
    if words[0] == "pip":
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        extra = re.fullmatch(r"\.\[(\w+)\]", words[2])
        assert extra is not None and extra[1] in extras["optional-dependencies"]
    else:
        assert words[0] == "python" and (ROOT / words[1]).exists()


def extended(tables: Any, more: Any) -> Any:
    """Tables with what more says; arms, obstacles and cases are known by their names."""
    if isinstance(tables, Mapping) and isinstance(more, Mapping):
        if "kind" in more:
            return more
        both = {key: extended(tables[key], more[key]) for key in tables if key in more}
        return {**tables, **more, **both}
    if isinstance(more, list) and all(
        isinstance(each, Mapping) and "name" in each for each in more
    ):
        found = {each["name"]: each for each in tables}
        for each in more:
            found[each["name"]] = extended(found.get(each["name"], {}), each)
        return list(found.values())
    return more


def run_shell(block: Block) -> None:
    for line in block.text.replace("\\\n", "").splitlines():
        (check_line if block.words == "parsed" else run_line)(line)


def run_tables(block: Block) -> None:
    tables = tomllib.loads(block.text)
    if block.words == "parsed":
        assert {*tables} <= {*RobotArm.model_fields, *StudyFile.model_fields}
        return
    if is_study(tables):
        Path(block.words).write_text(block.text)
        check_study(Study.read(block.words))
        return
    into = re.fullmatch(r"into ([\w-]+)", block.words)
    if into is None:
        Path(block.words).write_text(block.text)
    else:
        file = Path(f"problems/{into[1]}.toml")
        tables = extended(tomllib.loads(file.read_text()), tables)
    problem = copose.parse(tables)
    found = check(problem)
    assert into is not None or all(start.closed for start in found.starts)
    described(problem, found.arms)


def run_python(block: Block) -> None:
    if block.words == "parsed":
        ast.parse(block.text)
        return
    exec(compile(block.text, block.language, "exec"), {})


RUNNERS: dict[str, Callable[[Block], None]] = {
    "sh": run_shell,
    "toml": run_tables,
    "python": run_python,
}


@pytest.mark.parametrize("name", [name for name in topics() if BLOCKS[name]])
def test_the_blocks_of_the_manual_run(name: str, here: Path, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in BLOCKS[name]:
            RUNNERS[block.language](block)
    for line in labels(PAGES[name]):
        assert line in printed.getvalue()
    drawn = {
        "getting-started": "cell/before_after.png",
        "torques": "told/before_after.png",
        "paths": "carried/path.png",
    }
    for shown in pictures(name):
        # Those of the live page and of studies are the gallery's.
        if not (shown.name.startswith("live-") or shown.parent.name == "gallery"):
            same_picture(shown, here / drawn[name])


def test_every_command_and_option_is_in_the_manual(capsys) -> None:
    def helped(*command: str) -> str:
        assert main([*command, "--help"]) == 0
        return capsys.readouterr().out

    told = PAGES["commands"] + PAGES["robots"]
    commands = re.findall(r"^    (\w+)  ", helped(), re.M)
    assert {"check", "solve", "path"} <= {*commands}
    for command in commands:
        assert f"| `copose {command}" in told
        for option in {*re.findall(r"--[a-z-]+", helped(command))} - {"--help"}:
            assert f"`{option}" in told, (command, option)


def labels(text: str) -> Iterator[str]:
    """What tables of printed lines begin with."""
    for table in re.findall(r"^\| line \| .*?\n\n", text, re.M | re.S):
        yield from re.findall(r"^\| `(.*?)` \|", table, re.M)


def templates(file: Path) -> Iterator[str]:
    """The texts of a module, with … for what is put into them."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.JoinedStr):
            parts = (part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
            yield "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_the_messages_of_the_manual_are_those_of_the_program() -> None:
    texts = "\n".join(text for file in SOURCE.rglob("*.py") for text in templates(file))
    messages = re.findall(r"^- (`.*`)\\$", PAGES["troubleshooting"], re.M)
    assert len(messages) > 70
    for message in re.findall("`(.*?)`", " ".join(messages)):
        for part in filter(None, (part.strip(" …") for part in message.split("…"))):
            assert part in texts, message


def test_the_notation_is_that_of_the_code() -> None:
    rows = re.findall(r"^\|[^|]*\| (`.*`) \| `(\w+/\w+.py)` \|$", PAGES["theory"], re.M)
    assert len(rows) > 10
    for cell, file in rows:
        code = (SOURCE / file).read_text()
        for name in re.findall("`(.*?)`", cell):
            assert re.search(rf"\b{name}\b", code), (name, file)
