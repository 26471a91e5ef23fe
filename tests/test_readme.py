"""README and manual are true: every block in them is run."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

import copose
from copose.cli import main
from copose.manual import page, topics
from reference import PROBLEMS

ROOT = PROBLEMS.parent
README = (ROOT / "README.md").read_text()
PAGES = {"README": README} | {topic: page(topic) for topic in topics()}
BLOCKS = {
    name: re.findall(r"^```(\w+)\n(.*?)^```$", text, re.M | re.S) for name, text in PAGES.items()
}


def blocks(language: str, name: str = "README") -> list[str]:
    return [text for kind, text in BLOCKS[name] if kind == language]


def pictures(name: str) -> list[Path]:
    folder = ROOT if name == "README" else ROOT / "src/copose/manual"
    return [folder / file for file in re.findall(r"!\[.*\]\((.*)\)", PAGES[name])]


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
    found = {name: [kind for kind, _ in some] for name, some in BLOCKS.items() if some}
    assert found == {
        "README": ["sh", "text", "sh", "text", "sh", "python", "sh"],
        "robots": ["toml"],
        "paths": ["toml"],
        "commands": ["sh"],
        "python": ["python", "python", "python"],
    }


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    folder = ROOT if name == "README" else ROOT / "src/copose/manual"
    for target in re.findall(r"\]\(([^)#]+)\)", PAGES[name]):
        assert (folder / target).exists(), target


def test_the_readme_lists_the_manual_and_is_short() -> None:
    assert {*re.findall(r"src/copose/manual/([\w-]+)\.md", README)} == {*topics()}
    assert len(README.splitlines()) <= 200 and len(README.split()) <= 1500


def test_the_manual_is_printed(capsys) -> None:
    assert main(["manual"]) == 0
    listed = capsys.readouterr().out
    assert all(topic in listed for topic in topics())
    assert main(["manual", "paths"]) == 0
    assert "minimum-jerk" in capsys.readouterr().out
    assert main(["manual", "path"]) == 2
    told = "copose: TOPIC: no topic is called 'path'; did you mean 'paths'?"
    assert capsys.readouterr().err.startswith(told)


def test_the_first_command_prints_and_draws_what_is_shown(here: Path) -> None:
    printed = shell(blocks("sh")[0])

    def lasting(text: str) -> list[str]:
        lines = [line.rstrip() for line in text.splitlines()]
        # How many postures a search samples may differ by one from processor to processor.
        passing = ("built in", "closure error", "closed postures")
        return [line for line in lines if not any(words in line for words in passing)]

    assert lasting(printed) == lasting(blocks("text")[0])
    shown = imread(pictures("README")[0])
    drawn = imread(here / "paper-fig2/before_after.png")
    assert shown.shape == drawn.shape and np.abs(shown - drawn).mean() < 0.01


def test_the_picture_of_the_exact_set_is_what_evaluate_draws(here: Path) -> None:
    shell("copose solve problems/panda-lift.toml --quiet -o lift")
    shell("copose evaluate problems/panda-lift.toml --joints lift/result.json --quiet -o told")
    shown = imread(pictures("torques")[0])
    drawn = imread(here / "told/before_after.png")
    assert shown.shape == drawn.shape and np.abs(shown - drawn).mean() < 0.01


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


def test_the_commands_run(here: Path) -> None:
    printed = shell(blocks("sh", "commands")[0])
    assert "panda_joint7" in printed and "log-volume" in printed and "difference" in printed
    assert (here / "compare.png").exists()
    assert (here / "panda.pdf").exists() and (here / "panda/result.json").exists()


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


def test_the_problem_file_solves_and_so_does_its_path() -> None:
    text, path = blocks("toml", "robots")[0], blocks("toml", "paths")[0]
    assert copose.solve(copose.parse(tomllib.loads(text))).status == "solved"
    assert copose.plan(copose.parse(tomllib.loads(text + path))).status == "solved"


def test_the_picture_of_the_motion_is_what_path_draws(here: Path) -> None:
    shell("copose path problems/panda-carry-path.toml --quiet -o carried")
    shown = imread(pictures("paths")[0])
    drawn = imread(here / "carried/path.png")
    assert shown.shape == drawn.shape and np.abs(shown - drawn).mean() < 0.01


def test_the_python_blocks_run(here: Path, capsys) -> None:
    for name in ("README", "python"):
        for text in blocks("python", name):
            exec(compile(text, name, "exec"), {})
        assert "2.727" in capsys.readouterr().out and (here / "before_after.svg").exists()
        (here / "before_after.svg").unlink()
