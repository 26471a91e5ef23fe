"""Robots of example-robot-data made into problems by `copose init`, and solved as they are.

    python benchmarks/setups.py [--only WORD] [--output FILE]

Every URDF with one arm is taken twice, facing each other; one with several arms as it is. Writes a
page of Markdown: `copose init` and `copose solve --effort low` in processes of their own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tables import table

from copose.errors import InputError
from copose.robots.files.file_paths import EXAMPLES, resolve
from copose.robots.files.urdf_tree import read_tree
from copose.setup.chains import find_chains

HERE = Path(__file__).parent
FOLDER = resolve(f"{EXAMPLES}panda_description/urdf/panda.urdf", HERE, {}).parents[2]
LIMIT = 300.0


def command(*arguments: str, here: Path) -> tuple[int, float, str]:
    """Exit status, seconds, and what a command of copose said."""
    began = time.perf_counter()
    try:
        answer = subprocess.run(
            [sys.executable, "-m", "copose", *arguments], cwd=here, text=True, check=False,
            capture_output=True, timeout=LIMIT,
        )  # fmt: skip
        status, said = answer.returncode, answer.stderr.strip()
    except subprocess.TimeoutExpired:
        status, said = -1, f"longer than {LIMIT:g} s"
    return status, time.perf_counter() - began, said.removeprefix("copose: ").replace("|", "/")


def row(name: str, folder: Path) -> list[str] | None:
    """Robot, arms, exits and seconds of both commands, closed or not; None without arms."""
    try:
        arms = find_chains(read_tree(FOLDER / name, {}, {}))
    except InputError as error:
        return [name, "", "2", "", "", "", "no", error.message]
    if not arms:
        return None
    robots = [f"{EXAMPLES}{name}"] * (2 if len(arms) == 1 else 1)
    made, init_s, said = command("init", *robots, "-o", "p.toml", "--overwrite", here=folder)
    solved, solve_s = "", ""
    if made in (0, 3):
        status, seconds, told = command(
            "solve", "p.toml", "--effort", "low", "-o", "p", here=folder
        )
        solved, solve_s, said = str(status), f"{seconds:.1f}", told or said
    what = "twice" if len(robots) > 1 else f"{len(arms)} arms"
    joints = ", ".join(str(len(arm.joints)) for arm in arms)
    closed = "yes" if solved == "0" else "no"
    return [name, f"{what}: {joints}", str(made), f"{init_s:.1f}", solved, solve_s, closed, said]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="robots whose file has this in its name")
    parser.add_argument("--output", type=Path, default=HERE / "results" / "setups.md")
    arguments = parser.parse_args()
    heads = ["robot", "arms", "init exits", "s", "solve exits", "s", "closed", "said"]
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as folder:
        for file in sorted(FOLDER.rglob("*.urdf")):
            name = str(file.relative_to(FOLDER))
            found = row(name, Path(folder)) if arguments.only in name else None
            if found is None:
                continue
            print(*found, flush=True)
            rows.append(found)
            closed = sum(each[-2] == "yes" for each in rows)
            page = [
                "# Problems made by `copose init`, solved as they are",
                f"{closed} of {len(rows)} close. Seconds are those of whole commands, without a "
                "picture of the start, on a machine that others use too.",
                table(heads, rows),
            ]
            arguments.output.write_text("\n\n".join(page))


if __name__ == "__main__":
    main()
