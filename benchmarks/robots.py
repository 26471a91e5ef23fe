"""Every arm of example-robot-data, checked, and ten robots of different kinds, solved in pairs.

    python benchmarks/robots.py [--only WORD] [--output FILE]

An arm is a way from the root of a URDF to an end with six movable joints or more; of ends behind
the same six joints the nearest counts, and fingers that follow each other are none. It is checked
alone, with and without collision. Pairs hold an object by construction, see `building.py`. Writes a
page of Markdown.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from building import cell
from tables import table

import copose
from copose.errors import InputError
from copose.robots.files.file_paths import EXAMPLES, resolve
from copose.robots.files.tree import MOVABLE
from copose.robots.files.urdf_tree import read_tree

HERE = Path(__file__).parent
FOLDER = resolve(f"{EXAMPLES}panda_description/urdf/panda.urdf", HERE, {}).parents[2]
FEWEST = 6
EXITS = {"solved": 0, "infeasible": 3, "failed": 4}
PAIRS = {
    "panda": ("panda", "panda"),
    "xarm7": ("xarm7", "xarm7"),
    "ur5": ("ur5", "ur5"),
    "ur10": ("ur10", "ur10"),
    "kinova": ("kinova", "kinova"),
    "z1": ("z1", "z1"),
    "talos": ("talos", "talos"),
    "pr2": ("pr2-left", "pr2-right"),
    "tiago_dual": ("tiago-left", "tiago-right"),
}
# A problem about which there is nothing to say; what is said is of its robots.
QUIET: dict[str, Any] = {
    "objective": {"kind": "volume", "axes": ["x", "y", "z"]},
    "ellipsoid": {"load_distribution": "nonsqueezing"},
}
# What is said of every robot without a motor's inertia.
COMMON = "gears are ignored"


def tips(file: Path) -> dict[str, int]:
    """The ends of a URDF's arms, and how many joints each has."""
    tree = read_tree(file)
    parents = {joint.parent for joint in tree.joints.values()}
    leaders = {joint.mimic.leader for joint in tree.joints.values() if joint.mimic}
    arms: dict[tuple[str, ...], tuple[int, str]] = {}
    for leaf in (link for link in tree.links if link not in parents):
        link, names = tree.root, list[str]()
        for joint in reversed(tree.ancestors(leaf)):
            if joint.mimic or joint.name in leaders:
                break
            link = joint.child
            names += [joint.name] if joint.kind in MOVABLE else []
        if len(names) >= FEWEST:
            here = len(names), link
            arms[*names[:FEWEST]] = min(arms.get((*names[:FEWEST],), here), here)
    return {link: count for count, link in arms.values()}


def alone(urdf: str, tip: str, collision: bool) -> dict[str, Any]:
    """The problem of one arm of a robot."""
    return QUIET | {
        "format": 1, "name": "arm", "task": {"space": "spatial"},
        "object": {"mass": 1.0, "inertia": [0.01] * 3, "position": [0.5, 0.0, 0.5],
                   "shape": {"kind": "sphere", "radius": 0.05}},
        "constraints": {"collision": collision},
        "arms": [{"name": "arm", "urdf": urdf, "tip": tip, "grasp": {"position": [0, 0, 0]}}],
    }  # fmt: skip


def row(name: str, ask: Callable[[], tuple[int, tuple[str, ...]]]) -> list[str]:
    """Robot, exit, seconds and notes of one question."""
    began = time.perf_counter()
    try:
        status, notes = ask()
    except InputError as error:
        status, notes = 2, (str(error),)
    seconds = time.perf_counter() - began
    told = [note.replace("|", "/") for note in notes if not note.startswith(COMMON)]
    print(name, status, f"{seconds:.1f} s", flush=True)
    return [name, str(status), f"{seconds:.2f}", "; ".join(told)]


def checked(only: str) -> Iterator[list[str]]:
    """A row for every arm of every URDF, and one more where collision changes what is told."""
    for file in sorted(FOLDER.rglob("*.urdf")):
        name = str(file.relative_to(FOLDER))
        if only not in name:
            continue
        try:
            arms = tips(file)
        except InputError as error:
            yield [name, "2", "", str(error)]
            continue
        for tip, count in arms.items():
            rows = []
            for collision in (False, True):
                problem = copose.parse(alone(f"{EXAMPLES}{name}", tip, collision))
                label = f"{name}: {tip} ({count})" + (", collision" if collision else "")
                rows.append(row(label, lambda problem=problem: (0, copose.check(problem).notes)))
            yield rows[0]
            if rows[1][1:2] + rows[1][3:] != rows[0][1:2] + rows[0][3:]:
                yield rows[1]


def solved(only: str) -> Iterator[list[str]]:
    """A row for every pair."""
    shipped = tomllib.loads((HERE.parent / "problems" / "baxter-box.toml").read_text())
    for name in (*PAIRS, "baxter"):
        if only in name:
            tables = cell(name, PAIRS[name], 0)[0] if name in PAIRS else shipped
            yield row(name, lambda tables=tables: answered(tables | QUIET))


def answered(tables: dict[str, Any]) -> tuple[int, tuple[str, ...]]:
    """Exit and notes of a solve."""
    solution = copose.solve(copose.parse(tables))
    return EXITS[solution.status], (
        *([solution.reason] if solution.reason else []),
        *solution.notes,
    )


def main() -> None:
    """Ask, and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", metavar="WORD", help="robots with it in their names")
    parser.add_argument("--output", type=Path, default=HERE / "results/robots.md", metavar="FILE")
    arguments = parser.parse_args()
    head = ["robot", "exit", "seconds", "notes"]
    arms, pairs = list(checked(arguments.only)), list(solved(arguments.only))
    page = f"# Arms, checked\n\n{table(head, arms)}\n\n# Pairs, solved\n\n{table(head, pairs)}\n"
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(page)


if __name__ == "__main__":
    main()
