"""What commands print fits into 80 columns, and stays as it is.

Tables are made of results that are kept in ``snapshots``, so that no machine's digits matter;
``python tests/test_tables.py`` solves their problems anew and writes what tables then are.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from rich.cells import cell_len
from rich.console import Console, RenderableType

import copose
from cells import planar
from copose.cell.notes import once
from copose.manual import page
from copose.motion import described
from copose.report import compare
from copose.report.text import chains, comparison_table, guesses, motion_table, solution_table
from copose.report.text.columns import shared_beginning
from copose.results import Motion, Solution, read_motion, read_solution
from copose.setup import Wishes, draft
from reference import PROBLEMS, example

SNAPSHOTS = Path(__file__).parent / "snapshots"
SOLVED = {
    "planar": "paper-fig2", "spatial": "two-panda-box", "acceleration": "panda-lift",
    "payload": "panda-payload", "collision": "pr2-box", "cases": "panda-three-cases",
    "offsets": "panda-sliding-grasp",
}  # fmt: skip
OTHERS = ["evaluate", "nothing-free", "path", "compare", "compare-cases", "verbose",
          "path-verbose", "check", "init"]  # fmt: skip
ROBOTS = ["panda_description/urdf/panda.urdf", "ur_description/urdf/ur5_robot.urdf"]


def at_best(joints: int) -> copose.Problem:
    """Two planar arms of so many joints each that start in their best posture."""
    cell = planar(2, joints, "planar-linear")
    best = copose.solve(copose.parse(cell)).after.joints
    for arm in cell["arms"]:
        arm["start"] = list(best[arm["name"]])
    return copose.parse(cell)


@cache
def kept(name: str) -> Solution:
    return read_solution(SNAPSHOTS / f"{name}.json")


@cache
def moved() -> Motion:
    return read_motion(SNAPSHOTS / "path.json")


def made(name: str) -> RenderableType:
    """What a command prints."""
    if name == "path":
        return motion_table(moved())
    if name == "path-verbose":
        return motion_table(moved(), verbose=True)
    if name == "verbose":
        return solution_table(kept("cases"), verbose=True)
    if name == "compare":
        names = "somewhere/two-panda-box/result.json", "somewhere/panda-payload/result.json"
        return comparison_table(compare(kept("spatial"), kept("payload"), names))
    if name == "compare-cases":
        return comparison_table(compare(kept("cases"), kept("cases"), ("a.json", "b.json")))
    if name == "check":
        problem = copose.load(PROBLEMS / "pr2-box.toml")
        found = copose.check(problem)
        return chains(problem, found.starts, found.notes, described(problem, found.arms))
    if name == "init":
        robots = [str(example(robot)) for robot in ROBOTS]
        return guesses(draft(robots, Path("cell.toml"), Wishes()).guesses)
    return solution_table(kept(name))


@cache
def printed(name: str) -> str:
    console = Console(width=80, file=io.StringIO(), highlight=False)
    console.print(made(name))
    return "".join(f"{line.rstrip()}\n" for line in console.file.getvalue().splitlines())


def blocks(text: str) -> Iterator[tuple[list[list[str]], list[list[str]]]]:
    """Titles and rows of every table."""
    for part in text.split("\n\n"):
        titles, rows = ([line.split(bar) for line in part.splitlines() if bar in line]
                        for bar in "┃│")  # fmt: skip
        if rows:
            yield titles, rows


@pytest.mark.parametrize("name", [*SOLVED, *OTHERS])
def test_it_fits_into_80_columns_and_is_as_before(name: str) -> None:
    text = printed(name)
    assert max(map(cell_len, text.splitlines())) <= 80
    assert not re.search(r"\S…|…\S", text)
    assert text == (SNAPSHOTS / f"{name}.txt").read_text()


@pytest.mark.parametrize("name", [*SOLVED, *OTHERS])
def test_numbers_stand_below_one_another(name: str) -> None:
    for titles, rows in blocks(printed(name)):
        widths = {tuple(map(len, row[:-1])) for row in (*titles, *rows)}
        assert len(widths) == 1
        for k in range(1, len(titles[0])):
            if titles[0][k].strip():
                ends = {len(row[k].rstrip()) for row in rows if row[k].strip()}
                assert len(ends) <= 1, (titles, rows)


@pytest.mark.parametrize("name", [*SOLVED, "evaluate"])
def test_every_name_is_whole(name: str) -> None:
    text, solution = printed(name), kept(name)
    for arm, joints in solution.joint_names.items():
        begin = shared_beginning(joints)
        assert f"\n{arm}: {begin}* " in text
        for joint in joints:
            assert re.search(rf"^  {re.escape(joint.removeprefix(begin))} +│", text, re.M)
    for posture in (solution.after, *(solution.cases or ())):
        if posture is not None and posture.collision is not None:
            assert " – ".join(posture.collision.pair) in text


def test_what_was_asked_for_comes_first_and_the_search_last() -> None:
    lines = [line for line in printed("collision").splitlines() if line]
    assert lines[0] == "pr2-box: solved" and "volume ×9.23" in lines[3]
    assert lines[4].startswith("at joint limits:") and lines[5].startswith("nearest bodies:")
    assert lines[7].startswith("joint, rad or m")
    assert lines[-2] == "1 local optimum; met 4 times from 12 starts"
    assert lines[-1].startswith("one more start finds another optimum with a chance of about")


def test_a_gain_of_one_says_whether_anything_was_free() -> None:
    assert "×1: nothing was free: " in printed("nothing-free")
    shown = io.StringIO()
    Console(file=shown, width=80).print(solution_table(copose.solve(at_best(3))))
    assert "×1: the posture before is the best that was found" in shown.getvalue()


def test_what_every_spatial_run_ends_with_is_one_line_and_the_manual_says_it() -> None:
    (line,) = [line for line in printed("spatial").splitlines() if "unit of length" in line]
    assert line.endswith("copose manual measures")
    told = " ".join(page("measures").split())
    assert "unit of length" in told and "nonsqueezing" in told and "Moore–Penrose" in told


@pytest.mark.parametrize(
    ("names", "begin"),
    [
        (["panda_joint1", "panda_joint2"], "panda_joint"), (["r_elbow", "r_wrist"], "r_"),
        (["j1", "j10", "j12"], "j"), (["elbow", "elevate"], ""), (["left", "left_2"], ""),
        (["arm_1_joint", "arm_2_joint"], "arm_"), (["only_1"], ""), (["a", "b"], ""),
    ],
)  # fmt: skip
def test_what_names_share(names: list[str], begin: str) -> None:
    assert shared_beginning(names) == begin


def test_notes_of_one_kind_are_one() -> None:
    notes = ["arm 'a': link 'p' is odd, the robot's", "gravity is 0", "arm 'a': odd",
             "arm 'b': link 'q' is odd, the robot's", "gravity is 0", "arm 'c': odd"]  # fmt: skip
    assert once(notes) == (
        "arms 'a', 'b': links 'p', 'q' is odd, the robot's", "gravity is 0", "arms 'a', 'c': odd",
    )  # fmt: skip


def store(name: str, answer: Solution | Motion) -> None:
    """Keep what tables are made of, nine digits of it."""
    data = json.loads(
        copose.results.to_json(answer), parse_float=lambda x: float(f"{float(x):.9g}")
    )
    data["problem"].pop("links", None)
    if data.get("knots"):
        few = slice(None, None, 12)
        for part, key in ((data, "knots"), (data, "time"), (data["least_norm"], "objective")):
            part[key] = part[key][few]
    postures = [data.get("before"), data.get("after"), *data.get("cases", []),
                *data.get("cases_before", []), *(data.get("knots") or [])]  # fmt: skip
    for posture in filter(None, postures):
        for each in (posture.get("exact_sets") or {}).values():
            each["vertices"] = []
    (SNAPSHOTS / f"{name}.json").write_text(json.dumps(data, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    for name, problem in SOLVED.items():
        store(name, copose.solve(copose.load(PROBLEMS / f"{problem}.toml")))
    payload = copose.load(PROBLEMS / "panda-payload.toml")
    store("evaluate", copose.evaluate(payload, kept("payload")))
    store("nothing-free", copose.solve(at_best(2)))
    store("path", copose.plan(copose.load(PROBLEMS / "panda-carry-path.toml")))
    for name in [*SOLVED, *OTHERS]:
        (SNAPSHOTS / f"{name}.txt").write_text(printed(name))
