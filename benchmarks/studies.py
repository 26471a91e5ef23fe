"""Studies: what a point costs beyond its computation, what a second worker brings, how a record is
resumed.

    python benchmarks/studies.py [--points 2000] [--lines 200000]

Writes `results/studies.md`. Rates are of one run on this machine, ratios within it.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import machine

from copose.batch import RunOptions, run_points
from copose.batch.point_solver import PointSolver, Recipe, points_of
from copose.posture import Planner
from copose.progress import Progress, watched
from copose.studies import Study, StudyFolder
from copose.studies.points.line import PointLine
from copose.studies.points.points import Point
from copose.studies.record import StudyRecord

ROOT = Path(__file__).parents[1]
PAGE = Path(__file__).parent / "results/studies.md"


def study(folder: Path, problem: str, text: str) -> Study:
    """A study of a shipped problem."""
    file = folder / f"{problem}.toml"
    head = f'format = 1\nname = "{problem}"\nproblem = "{ROOT}/problems/{problem}.toml"\n'
    file.write_text(head + text)
    return Study.read(file)


def poses(folder: Path, count: int) -> Study:
    """So many poses of a box that two Pandas hold, most of them in reach."""
    text = f"""effort = "low"
[[vary]]
key = "object.position.x"
from = 0.4
to = 0.6
[[vary]]
key = "object.position.y"
from = -0.3
to = 0.3
[[vary]]
key = "object.position.z"
from = 0.2
to = 0.8
[sample]
method = "sobol"
count = {count}
"""
    return study(folder, "two-panda-box", text)


def masses(folder: Path, count: int) -> Study:
    """So many masses of an object in the plane, each measured at the start."""
    text = f"""command = "evaluate"
[[vary]]
key = "object.mass"
from = 0.1
to = 5.0
steps = {count}
"""
    return study(folder, "paper-fig2", text)


def cost_of_points(asked: Study, count: int) -> dict[str, float]:
    """Processor ms a point: solved as a study does, and by `Planner.solve` alone, by turns; and of
    points that no posture holds.
    """
    solver, file = PointSolver(Recipe.of(asked)), asked.file
    planner = Planner(asked.problems.at(asked.points.values(0)), movable=True)
    planner.compile()
    seconds: dict[str, list[float]] = {"study": [], "planner": [], "open": []}
    for point in points_of(asked, range(count)):
        solver.line(point)
    for point in points_of(asked, range(count)):
        problem = asked.problems.at(point.values)
        began = time.process_time()
        line = solver.line(point)
        between = time.process_time()
        planner.solve(problem=problem, seed=point.seed, effort=file.effort)
        end = time.process_time()
        if line.status == "solved":
            seconds["study"].append(between - began)
            seconds["planner"].append(end - between)
        else:
            seconds["open"].append(between - began)
    return {name: 1e3 * statistics.mean(values) for name, values in seconds.items() if values}


def cost_of_measuring(asked: Study) -> dict[str, float]:
    """Processor ms a point that is measured, and of that `Planner.evaluate` alone."""
    solver = PointSolver(Recipe.of(asked))
    points = list(points_of(asked, range(len(asked.points))))
    solver.line(points[0])
    planner = Planner(asked.problems.at({}), movable=True)
    planner.compile()
    problem = asked.problems.at({})
    starts = {arm.name: arm.start or () for arm in problem.arms}
    began = time.process_time()
    lines = [solver.line(point).text for point in points]
    between = time.process_time()
    for point in points:
        planner.evaluate(starts, problem=asked.problems.at(point.values))
    end = time.process_time()
    for point in points:
        asked.problems.at(point.values)
    parsed = time.process_time() - end
    each = 1e3 / len(lines)
    return {"study": each * (between - began), "planner": each * (end - between - parsed)}


def rate(asked: Study, folder: Path, workers: int) -> float:
    """Points a second, from the first that is done to the last."""
    stamps: list[tuple[int, float]] = []

    def told(now: Progress) -> None:
        if now.stage == "solving points" and now.done:
            stamps.append((now.done, time.perf_counter()))

    with watched(told):
        run_points(asked, StudyFolder(folder / f"workers-{workers}"), RunOptions(workers=workers))
    (first, began), (last, ended) = stamps[0], stamps[-1]
    return (last - first) / (ended - began)


def resumption(asked: Study, folder: Path) -> tuple[float, float]:
    """Seconds until what is missing of a whole record is known, and lines that are appended to it a
    second.
    """
    place, count = StudyFolder(folder / "resumed"), len(asked.points)
    texts = [made_line(point).text for point in points_of(asked, range(count))]
    with StudyRecord(place.record) as record:
        began = time.perf_counter()
        for text in texts:
            record.append(text)
        appended = count / (time.perf_counter() - began)
    again = Study.read(asked.file.source)
    began = time.perf_counter()
    outcome = run_points(again, place)
    assert outcome.done == count
    return time.perf_counter() - began, appended


def made_line(point: Point) -> PointLine:
    """A line as long as that of two arms in the plane."""
    joints = {"a1": [0.123456789012345] * 3, "a2": [0.123456789012345] * 3}
    return PointLine(point, "solved", None, objective=0.123456789, joints=joints, seconds=0.001)


def main() -> None:
    """Measure everything and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", type=int, default=2000, help="poses of two Pandas")
    parser.add_argument("--lines", type=int, default=200_000, help="of the record that is resumed")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        boxes = poses(folder, arguments.points)
        solved = cost_of_points(boxes, min(arguments.points, 200))
        measured = cost_of_measuring(masses(folder, 2000))
        alone = rate(boxes, folder, 1)
        pair = rate(boxes, folder, 2)
        seconds, appended = resumption(masses(folder, arguments.lines), folder)
    rows = [
        ("two Pandas and the box, a point of a study, processor ms", f"{solved['study']:.1f}"),
        ("`Planner.solve` of the same problems alone, processor ms", f"{solved['planner']:.1f}"),
        (
            "points that no posture holds, over those that one does",
            f"{solved['open'] / solved['study']:.2f}" if "open" in solved else "none met",
        ),
        ("two planar arms, a point that is measured, processor ms", f"{measured['study']:.2f}"),
        ("`Planner.evaluate` of the same alone, processor ms", f"{measured['planner']:.2f}"),
        (f"plain loop, {arguments.points} poses, points/s", f"{alone:.1f}"),
        ("two workers, points/s", f"{pair:.1f}"),
        ("two workers over the plain loop", f"{pair / alone:.2f}"),
        (f"what is missing of {arguments.lines} lines is known after, s", f"{seconds:.1f}"),
        ("lines that are appended to a record, 1/s", f"{appended:.0f}"),
    ]  # fmt: skip
    table = "\n".join(f"| {what} | {value} |" for what, value in rows)
    facts = ", ".join(f"{key} {value}" for key, value in machine.facts().items())
    page = f"# Studies\n\nBy `python benchmarks/studies.py` on {facts}.\n\n"
    PAGE.write_text(f"{page}| measured | |\n| --- | ---: |\n{table}\n")
    print(table)


if __name__ == "__main__":
    main()
