"""Tables and pictures of what is free, of obstacles and bodies, and of several cases."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path as MplPath
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from rich.console import Console
from scipy.spatial import ConvexHull

import copose
from cells import closed_postures, tables
from copose.cell.cell import Cell
from copose.commands.command_line import main
from copose.poses import Pose
from copose.posture import Planner
from copose.posture.evaluation import evaluate
from copose.problem import parse
from copose.report import compare, draw_comparison, picture
from copose.report.figures.cases import cases_figure
from copose.report.figures.planar import planar_figure
from copose.report.figures.spatial import spatial_figure
from copose.report.geometry.camera import View, best_view
from copose.report.geometry.hulls import LinkBodies, LinkBody
from copose.report.geometry.shapes import cut, near_obstacles, ranges
from copose.report.look import LOOK
from copose.report.panels import NOWHERE, case_rows, moved_words
from copose.report.panels import result_panels as panels
from copose.report.scene import polygons
from copose.report.text import comparison_table, solution_table
from copose.report.words import result_heading, three
from copose.results import (
    CasePosture,
    CollisionRecord,
    FreeRecord,
    LinkRecord,
    ObjectiveRecord,
    Posture,
    ProblemRecord,
    Solution,
    matrix,
    to_json,
)
from reference import example

# Offsets of the spatial result's answer to the file's pose, and the ranges they are free in.
MOVED = {
    "object.x": (-0.1, 0.1, -0.06),
    "object.z": (-0.1, 0.2, 0.05),
    "object.yaw": (-0.5, 0.5, 0.2),
    "right.base.x": (-0.2, 0.2, -0.12),
    "right.base.y": (-0.1, 0.1, 0.1),
    "left.grasp.z": (-0.04, 0.02, 0.01),
}
OBSTACLES = [
    {"name": "table", "shape": {"kind": "box", "size": [0.6, 0.8, 0.04]},
     "position": [0.5, 0, 0.15], "rpy": [0, 0, 0.3]},
    {"name": "ball", "shape": {"kind": "sphere", "radius": 0.1}, "position": [0.2, -0.2, 0.9]},
    {"name": "pillar", "shape": {"kind": "cylinder", "radius": 0.05, "length": 0.4},
     "position": [0.5, 0.2, 0.5]},
    {"name": "pipe", "shape": {"kind": "capsule", "radius": 0.05, "length": 0.3},
     "position": [0.5, -0.1, 0.9], "rpy": [0, math.pi / 2, 0]},
]  # fmt: skip
FLAT_OBSTACLES = [
    {"name": "wall", "shape": {"kind": "box", "size": [0.1, 0.6]}, "position": [1.1, 0.5],
     "angle": 0.3},
    {"name": "post", "shape": {"kind": "disk", "radius": 0.08}, "position": [0.3, 0.9]},
]  # fmt: skip


def spatial_cell(moved: bool) -> dict:
    """Two Pandas and a box, where the file has them or moved."""
    x = {name: values[2] * moved for name, values in MOVED.items()}
    cell = tables("two-panda-box")
    cell["object"] |= {"position": [0.5 + x["object.x"], 0.0, 0.5 + x["object.z"]],
                       "rpy": [0, 0, x["object.yaw"]], "freedom": {"x": [-0.1, 0.1]}}  # fmt: skip
    left, right = cell["arms"]
    left["grasp"]["position"] = [-0.25, 0, x["left.grasp.z"]]
    left["freedom"] = {"grasp": {"z": [-0.1, 0.1]}}
    right["base"]["position"] = [1 + x["right.base.x"], x["right.base.y"], 0]
    right["freedom"] = {"base": {"x": [-0.2, 0.2]}}
    return cell | {"obstacles": OBSTACLES}


@cache
def spatial_ends() -> tuple[Solution, Solution]:
    """A posture at the file's pose and one at the moved."""
    found = []
    for moved in (False, True):
        problem = parse(spatial_cell(moved))
        cell = Cell.of(problem)
        drawn = {arm.name: closed_postures(cell, i, 64)[0] for i, arm in enumerate(cell.arms)}
        found.append(evaluate(problem, {name: q.tolist() for name, q in drawn.items()}))
    return found[0], found[1]


@cache
def flat() -> Solution:
    """A planar result in which the object, a base and a grasp were moved."""
    cell = tables("two-planar-4r")
    cell["object"]["freedom"] = {"x": [-0.1, 0.1], "y": [-0.1, 0.1], "angle": [-0.5, 0.5]}
    cell["arms"][0]["freedom"] = {"base": {"x": [-0.2, 0.2]}, "grasp": {"y": [-0.05, 0.05]}}
    return Planner(parse(cell | {"obstacles": FLAT_OBSTACLES})).solve(effort="low")


def with_case(posture: Posture, name: str, weight: float, objective: float | None) -> CasePosture:
    given = {key: getattr(posture, key) for key in posture.model_fields_set}
    return CasePosture(**given, name=name, weight=weight, objective=objective)


@cache
def placed(before: bool = True) -> Solution:
    """As `copose solve` has it."""
    one, other = spatial_ends()
    values = {"before": one.objective.after if before else None, "after": other.objective.after}
    freedom = [
        FreeRecord(name=name, lower=low, upper=high, before=0.0 if before else None, after=after)
        for name, (low, high, after) in MOVED.items()
    ]
    return other.model_copy(
        update={
            "before": one.after if before else None,
            "freedom": tuple(freedom),
            "search": flat().search,
            "objective": ObjectiveRecord(kind="volume", unit="log", **values),
        }
    )


@cache
def in_cases(count: int = 3, before: bool = True, planar: bool = False) -> Solution:
    """The same postures as those of cases that weigh 1, 2, 3, …"""
    whole = flat() if planar else placed()
    values = {"before": [], "after": []}
    for k in range(count):
        values["before"].append(with_case(whole.before, f"case {k}", k + 1.0, 0.5 * k))
        values["after"].append(with_case(whole.after, f"case {k}", k + 1.0, 0.5 * k + 0.25))
    totals = {
        key: sum(case.weight * case.objective for case in cases) for key, cases in values.items()
    }
    records = [
        record.model_copy(update={"name": name, "before": record.before if before else None})
        for record in whole.freedom
        for name in (
            [f"case {k}: {record.name}" for k in range(count)]
            if record.name.startswith("object")
            else [record.name]
        )
    ]
    if not before:
        totals["before"] = None
    return whole.model_copy(
        update={
            "before": None,
            "after": None,
            "freedom": tuple(records),
            "cases": tuple(values["after"]),
            "cases_before": tuple(values["before"]) if before else None,
            "objective": ObjectiveRecord(kind="volume", unit="log", **totals),
        }
    )


def near(posture: Posture, distance: float = 0.0123) -> Posture:
    """With a smallest distance."""
    pair = CollisionRecord(distance=distance, pair=("left/link5", "table"))
    return posture.model_copy(update={"collision": pair})


def thick(solution: Solution, radius: float = 0.06) -> ProblemRecord:
    """A planar problem whose links have a radius."""
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) / np.cos(np.pi / 16)
    posture = solution.after or solution.cases[0]
    links = []
    for name, arm in posture.arms.items():
        ends = np.array(arm.skeleton)[1:]
        for k, length in enumerate(np.linalg.norm(np.diff(ends, axis=0), axis=1)):
            points = np.vstack([radius * ring, radius * ring + [length, 0, 0]])
            links.append(LinkRecord(arm=name, frame=k + 1, points=matrix(points)))
    return solution.problem.model_copy(update={"links": tuple(links)})


def fully(solution: Solution) -> Solution:
    """With bodies of all links, and every posture with a smallest distance, less after."""
    some = {"before": 0.03, "after": 0.0123, "cases": 0.0123, "cases_before": 0.03}
    update: dict[str, object] = {}
    if solution.problem.space.startswith("planar"):
        update["problem"] = thick(solution)
    for key, distance in some.items():
        value = getattr(solution, key)
        if isinstance(value, tuple):
            update[key] = tuple(near(p, distance + 0.01 * k) for k, p in enumerate(value))
        elif value is not None:
            update[key] = near(value, distance)
    return solution.model_copy(update=update)


def said(solution: Solution) -> str:
    console = Console(width=120, file=io.StringIO(), highlight=False)
    console.print(solution_table(solution, verbose=True))
    return console.file.getvalue()


def row(text: str, *starts: str) -> list[str]:
    """The other cells of the first line that starts so."""
    begins = re.compile(r"\s*│\s*".join(map(re.escape, starts)) + r"\s*│")
    line = next(line for line in text.splitlines() if begins.match(line))
    return [cell.strip() for cell in line.split("│")[len(starts) :]]


class TestTables:
    """Rows of what is new, and none where there is nothing new."""

    def test_free_coordinates(self) -> None:
        text = said(placed())
        assert row(text, "object.x") == ["-0.1 … 0.1", "+0.0000", "-0.0600", "m"]
        assert row(text, "object.yaw")[2:] == ["+0.2000", "rad, +11.5°"]
        assert row(text, "right.base.y")[2:] == ["+0.1000", "m, at its upper end"]
        assert row(text, "left.grasp.z") == ["-0.04 … 0.02", "+0.0000", "+0.0100", "m"]

    def test_of_a_real_search(self) -> None:
        text = said(flat())
        for record in flat().freedom:
            cells = row(text, record.name)
            assert cells[:2] == [f"{record.lower:g} … {record.upper:g}", "+0.0000"]
            assert float(cells[2]) == pytest.approx(record.after, abs=5e-5)
            at_end = min(record.after - record.lower, record.upper - record.after) < 1e-5
            assert ("end" in cells[3]) == at_end
        tried = flat().search.placements
        line = f"{tried.tried} placements tried, {tried.closed} of them closed"
        assert f"\n{line}, {tried.polished} polished\n" in text
        assert f" starts, {tried.tried} placements tried\n" in text

    def test_without_a_before(self) -> None:
        text = said(placed(before=False))
        assert row(text, "object.x") == ["-0.1 … 0.1", "-0.0600", "m"]
        assert "posture" not in text.split("log-volume  ")[0]

    def test_the_smallest_distance(self) -> None:
        text = said(fully(placed()))
        told = "nearest bodies: 0.0123 m, left/link5 – table; before 0.0300 m"
        assert told in " ".join(text.split())
        assert "nearest" not in said(placed())

    def test_cases(self) -> None:
        solution = fully(in_cases())
        text = said(solution)
        assert row(text, "case 1", "2") == ["0.500000", "0.750000", "log-volume, ×1.28"]
        total = row(text, "total", "")
        assert total[:2] == [f"{sum(w * o for w, o in ((2, 0.5), (3, 1.0))):.6f}", "5.500000"]
        # All gain 0.25, so does their mean.
        assert total[2] == "Σ weight · objective, ×1.28 on average"
        words = "volume ×1.28 on weighted average over 3 cases"
        assert result_heading(solution) == f"two-panda-box: {words}"
        joints = [f"{q:.4f}" for q in solution.cases[2].joints["right"]]
        shown = [line.split("│") for line in text.splitlines() if re.match(r"  \d +│", line)]
        assert [cells[3].strip() for cells in shown[7:14]] == joints
        told = "case 0: nearest bodies: 0.0123 m, left/link5 – table; before 0.0300 m"
        assert told in " ".join(text.split())
        assert row(text, "case 2: object.x")[2] == "-0.0600"
        assert row(text, "right.base.x")[2] == "-0.1200"

    def test_limits_of_cases(self) -> None:
        """Single numbers that torque limits decide, case by case."""
        held = in_cases().cases[0].model_copy(update={"payload": 7.5})
        text = said(in_cases().model_copy(update={"cases": (held,)}))
        assert row(text, "case 0: payload, kg")[1] == "7.50"

    def test_cases_without_a_before(self) -> None:
        text = said(in_cases(before=False))
        assert row(text, "case 1", "2") == ["0.750000", "log-volume"]
        assert row(text, "total", "") == ["5.500000", "Σ weight · objective"]

    def test_many_cases(self) -> None:
        assert "joints of 2 more cases: in result.json" in said(in_cases(count=8))

    def test_nothing_found(self) -> None:
        for solution in (placed(), in_cases()):
            nothing = {"after": None, "cases": None, "status": "failed", "reason": "no luck"}
            text = said(solution.model_copy(update=nothing))
            assert "failed: no luck" in text
            assert "free" not in text

    def test_nothing_new(self) -> None:
        plain = copose.solve(copose.load(Path(__file__).parents[1] / "problems/paper-fig2.toml"))
        text = said(plain)
        assert not any(word in text for word in ("free", "case", "nearest", "placement"))
        assert [ranges(panel) for panel in panels(plain)] == [[], []]


def edges(ax: object, color: str) -> np.ndarray:
    """Ends of the drawn edges of free ranges, (e, 2, d)."""
    found = [line for line in ax.lines if line.get_color() == color and line.is_dashed()]
    if ax.name == "3d":
        ends = [np.array(line.get_data_3d()).T for line in found]
    else:
        ends = [np.array(line.get_data()).T for line in found]
    return np.array([each for each in ends if len(each) == 2])


def corners(low: np.ndarray, high: np.ndarray) -> set[tuple[float, ...]]:
    grid = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(len(low), -1).T
    return {tuple(np.round(corner, 9) + 0.0) for corner in grid}


def rounded(points: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(p) for p in np.round(points.reshape(-1, points.shape[-1]), 9) + 0.0}


class TestRanges:
    """Dashed boxes are around the file's poses, before and after."""

    def test_in_space(self) -> None:
        figure = spatial_figure(panels(placed()), "")
        scenes = [ax for ax in figure.axes if ax.name == "3d"]
        assert len(scenes) == 2
        blue, green = LOOK.arms[:2]
        for ax, posture in zip(scenes, (placed().before, placed().after), strict=True):
            box = edges(ax, LOOK.ink)
            assert rounded(box) == corners(np.array([0.4, 0, 0.4]), np.array([0.6, 0, 0.7]))
            assert len(box) == 4
            base = edges(ax, green)
            assert rounded(base) == corners(np.array([0.8, -0.1, 0]), np.array([1.2, 0.1, 0]))
            assert len(base) == 4
            w, x, y, z = posture.object.quaternion
            R = Pose.from_rpy(rpy=(0, 0, 2 * math.atan2(z, w))).rotation
            assert x == y == 0
            ends = posture.object.position + np.array([[-0.25, 0, -0.04], [-0.25, 0, 0.02]]) @ R.T
            assert np.allclose(edges(ax, blue), [ends])

    def test_in_the_plane(self) -> None:
        figure = planar_figure(panels(flat()), "")
        for ax, posture in zip(figure.axes, (flat().before, flat().after), strict=True):
            box = edges(ax, LOOK.ink)
            assert len(box) == 4
            assert rounded(box) == corners(np.array([0.35, 0.4]), np.array([0.55, 0.6]))
            base, grasp = edges(ax, LOOK.arms[0])
            assert np.allclose(base, [[-0.2, 0], [0.2, 0]])
            a = posture.object.angle
            R = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
            local = (grasp - posture.object.position) @ R
            assert np.allclose(local, [[-0.15, -0.05], [-0.15, 0.05]])
            assert not len(edges(ax, LOOK.arms[1]))
            assert ax.get_aspect() == 1

    def test_a_box_has_twelve_edges(self) -> None:
        y = FreeRecord(name="object.y", lower=-0.3, upper=0.1, before=0.0, after=0.0)
        solution = placed().model_copy(update={"freedom": (*placed().freedom, y)})
        box = ranges(panels(solution)[1])[0].edges
        assert len({tuple(sorted(map(tuple, np.round(edge, 9)))) for edge in box}) == 12
        assert rounded(box) == corners(np.array([0.4, -0.3, 0.4]), np.array([0.6, 0.1, 0.7]))

    def test_angles_alone_have_none(self) -> None:
        kept = [r for r in placed().freedom if r.name.endswith("yaw")]
        solution = placed().model_copy(update={"freedom": tuple(kept)})
        assert [ranges(panel) for panel in panels(solution)] == [[], []]

    def test_of_a_case(self) -> None:
        """Each case has its own; what arms have is common to all."""
        solution = in_cases()
        moved = [
            r.model_copy(update={"upper": 0.15}) if r.name == "case 1: object.x" else r
            for r in solution.freedom
        ]
        solution = solution.model_copy(update={"freedom": tuple(moved)})
        for k, panel in enumerate(case_rows(solution)[1].panels):
            box, grasp, base = sorted(ranges(panel), key=lambda each: each.arm or "")
            assert box.edges[..., 0].max() == pytest.approx(0.65 if k == 1 else 0.6)
            assert (grasp.what, base.what) == ("grasp", "base")

    def test_a_given_posture(self) -> None:
        """Has a range where it is said how far from the file's it is, and else none."""
        records = [r.model_copy(update={"before": None, "after": None}) for r in placed().freedom]
        update = {"before": None, "search": None}
        unknown = placed().model_copy(update=update | {"freedom": tuple(records)})
        assert ranges(panels(unknown)[0]) == []
        known = placed().model_copy(update=update)
        assert len(ranges(panels(known)[0])) == 3

    def test_a_nearest_miss(self) -> None:
        """Is as near to the file's pose as the range lets it."""
        record = FreeRecord(name="object.x", lower=0.06, upper=0.2, before=None, after=None)
        miss = spatial_ends()[0].after.model_copy()
        solution = placed().model_copy(
            update={"before": None, "after": None, "nearest_miss": miss, "freedom": (record,)}
        )
        x = 0.5 - 0.06
        box = ranges(panels(solution)[0])[0].edges
        assert np.allclose(box[0, :, 0], [x + 0.06, x + 0.2])
        assert picture(solution, "svg")


@pytest.fixture
def scenes(monkeypatch: pytest.MonkeyPatch) -> Callable[[Solution], list[tuple[Axes, list]]]:
    """Scenes in space with the polygons that each was given."""

    class Known(Poly3DCollection):
        def __init__(self, verts: list, **more: object) -> None:
            super().__init__(verts, **more)
            self.given = [np.array(each) for each in verts]

    monkeypatch.setattr("copose.report.scene.polygons.Poly3DCollection", Known)

    def found(solution: Solution) -> list[tuple[Axes, list]]:
        shown = [ax for ax in spatial_figure(panels(solution), "").axes if ax.name == "3d"]
        filled = [[c for c in ax.collections if isinstance(c, Known)] for ax in shown]
        given = [[face for c in some for face in c.given] for some in filled]
        return list(zip(shown, given, strict=True))

    return found


class TestSurroundings:
    """Obstacles and bodies are where they are."""

    def test_obstacles_in_the_plane(self) -> None:
        for ax in planar_figure(panels(flat()), "").axes:
            drawn = [p for p in ax.patches if isinstance(p, Polygon) and p.get_hatch()]
            wall, post = (p.get_xy()[:-1] for p in drawn)
            c, s = math.cos(0.3), math.sin(0.3)
            half = np.array([[-0.05, -0.3], [0.05, -0.3], [0.05, 0.3], [-0.05, 0.3]])
            assert np.allclose(wall, [1.1, 0.5] + half @ np.array([[c, s], [-s, c]]))
            assert np.allclose(np.linalg.norm(post - [0.3, 0.9], axis=1), 0.08)
            names = {text.get_text(): text.get_position() for text in ax.texts}
            assert names.keys() >= {"wall", "post"}

    def test_obstacles_in_space(self) -> None:
        known = {
            body.name: body for body in near_obstacles(placed(), np.zeros(3) - 1, np.ones(3) * 1.5)
        }
        turned = Pose.from_rpy((0.5, 0, 0.15), (0, 0, 0.3))
        local = (known["table"].points - turned.position) @ turned.rotation
        assert np.allclose(np.abs(local), [0.3, 0.4, 0.02])
        ball = known["ball"].points - [0.2, -0.2, 0.9]
        assert np.allclose(np.linalg.norm(ball, axis=1), 0.1)
        pillar = known["pillar"].points - [0.5, 0.2, 0.5]
        assert np.allclose(np.abs(pillar[:, 2]), 0.2)
        assert np.linalg.norm(pillar[:, :2], axis=1).max() == pytest.approx(0.05)
        pipe = known["pipe"].points - [0.5, -0.1, 0.9]
        along = np.clip(pipe[:, 0], -0.15, 0.15)
        away = np.linalg.norm(pipe - np.outer(along, [1, 0, 0]), axis=1)
        assert np.allclose(away, 0.05)
        assert np.abs(pipe[:, 0]).max() == pytest.approx(0.2)

    def test_they_are_drawn(self, scenes: Callable) -> None:
        for ax, given in scenes(fully(placed())):
            every = {tuple(np.round(p, 6)) for face in given for p in face}
            turned = Pose.from_rpy((0.5, 0, 0.15), (0, 0, 0.3))
            for corner in ([-0.3, -0.4, 0.02], [0.3, 0.4, -0.02]):
                assert tuple(np.round(turned.position + turned.rotation @ corner, 6)) in every
            assert {"table", "ball", "pillar", "pipe"} <= {text.get_text() for text in ax.texts}
            spans = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
            ratio = ax._box_aspect / (spans[:, 1] - spans[:, 0])
            assert np.allclose(ratio, ratio[0])

    def test_what_is_far_is_cut(self) -> None:
        low, high = np.zeros(3), np.ones(3)
        floor = {"name": "floor", "shape": {"kind": "box", "size": [50, 50, 0.1]},
                 "position": [0, 0, -0.05]}  # fmt: skip
        far = floor | {"name": "far", "position": [0, 0, 9]}
        cell = spatial_cell(False) | {"obstacles": [floor, far]}
        record = placed().problem.model_copy(update={"obstacles": parse(cell).obstacles})
        solution = placed().model_copy(update={"problem": record})
        (body,) = near_obstacles(solution, low, high)
        assert body.name == "floor"
        assert np.allclose([body.points.min(axis=0), body.points.max(axis=0)],
                           [[-0.25, -0.25, -0.1], [1.25, 1.25, 0.0]])  # fmt: skip
        assert picture(solution, "png")
        # What is no larger than the scene is drawn whole.
        table = near_obstacles(placed(), np.zeros(3), np.ones(3))[0]
        assert table.name == "table"
        assert table.points.min() < -0.25

    def test_cut(self) -> None:
        """A triangle in a square: what is left has its area and lies in both."""
        triangle = np.array([[-1.0, 0.5], [2.0, 0.5], [0.5, 2.0]])
        part = cut(triangle, np.zeros(2), np.ones(2))
        x, y = part.T
        area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
        assert area == pytest.approx(0.5)
        assert len(cut(triangle + 5, np.zeros(2), np.ones(2))) == 0

    def test_links_in_the_plane(self) -> None:
        solution = fully(flat())
        for ax, panel in zip(
            planar_figure(panels(solution), "").axes, panels(solution), strict=True
        ):
            drawn = [p for p in ax.patches if isinstance(p, PathPatch)]
            assert len(drawn) == 2
            for patch, arm in zip(drawn, panel.posture.arms.values(), strict=True):
                points = np.array(arm.skeleton)[:, :2]
                middle = (points[1] + points[2]) / 2
                across = (points[2] - points[1])[::-1] * [-1, 1]
                across /= np.linalg.norm(across)
                inside = [middle + share * 0.06 * across for share in (-0.99, 0, 0.99)]
                parts = [MplPath(part) for part in patch.get_path().to_polygons()]
                assert np.any([part.contains_points(inside) for part in parts], axis=0).all()
                tip = points[-1] - points[-2]
                beyond = points[-1] + 0.062 * tip / np.linalg.norm(tip)
                assert not any(part.contains_point(beyond) for part in parts)

    def test_links_in_space(self) -> None:
        """Bodies reach as far as the meshes do where Pinocchio has them, within a few mm."""
        solution, arm = placed(), spatial_cell(True)["arms"][0]
        file = example(arm["urdf"].removeprefix("example-robot-data://"))
        model = pin.buildModelFromUrdf(str(file))
        shapes = pin.buildGeomFromUrdf(
            model, str(file), pin.GeometryType.COLLISION, package_dirs=[str(example("").parents[1])]
        )
        q = pin.neutral(model)
        q[: len(solution.after.joints["left"])] = solution.after.joints["left"]
        data, places = model.createData(), shapes.createData()
        pin.updateGeometryPlacements(model, data, shapes, places, q)
        truth = [
            np.array([place.act(corner) for corner in corners_of(each.geometry)])
            for each, place in zip(shapes.geometryObjects, places.oMg, strict=True)
        ]
        drawn = [b for b in LinkBodies.of(solution.problem).placed(solution.after)
                 if b.arm == "left"]  # fmt: skip
        assert len(drawn) == len(truth)
        directions = np.random.default_rng(0).normal(size=(50, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        reaches = [
            np.sort([(points @ directions.T).max(axis=0) for points in some], axis=0)
            for some in (truth, [body.points for body in drawn])
        ]
        assert np.all(reaches[1] <= reaches[0] + 2e-5)
        assert np.all(reaches[1] >= reaches[0] - 8e-3)
        # Faces look outwards.
        for body in drawn:
            assert np.all(body.points @ body.normals.T <= body.offsets + 1e-9)

    def test_bodies_are_drawn_but_for_sticks(self, scenes: Callable) -> None:
        bodies_of = LinkBodies.of(placed().problem).placed(placed().after)
        corners = {tuple(np.round(p, 6)) for body in bodies_of for p in body.points}
        sticks = placed().problem.model_copy(update={"links": ()})
        for problem, least, most in ((placed().problem, 0.4, 1.0), (sticks, 0.0, 0.0)):
            _, given = scenes(placed().model_copy(update={"problem": problem}))[-1]
            seen = {tuple(np.round(p, 6)) for face in given for p in face}
            assert least <= len(seen & corners) / len(corners) <= most
            # Polygons drawn together have as many corners each.
            assert len({len(face) for face in given}) == 1
        assert picture(placed(), "png") != picture(placed(), "png", "sticks")

    @pytest.mark.parametrize("corners", [3, 4, 7])
    def test_pieces(self, corners: int) -> None:
        """Are as large as the whole, and none has a long side."""
        turn = np.arange(corners) * 2 * np.pi / corners
        plane = np.array([[1.0, 2.0, 0.5], [-1.0, 0.2, 1.0]])
        face = np.column_stack([np.cos(turn), 2 * np.sin(turn)]) @ plane
        pieces = polygons._pieces(face, 0.3)
        longest = max(np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1).max() for p in pieces)
        assert longest <= 0.3 + 1e-12
        assert sum(map(area, pieces)) == pytest.approx(area(face))

    def test_the_view_shows_what_a_wall_hides(self) -> None:
        """A wall between the usual eye and two hands; beside it they are seen."""

        def block(x: float, y: float, half: tuple[float, float, float], last: bool) -> LinkBody:
            signs = 2 * np.array([*np.ndindex(2, 2, 2)]) - 1
            solid = ConvexHull([x, y, 0] + half * signs)
            faces = solid.points[solid.simplices]
            return LinkBody("arm", 3, last, faces, solid.equations[:, :3])

        eye, hands = View().axes[2], [block(x, 0, (0.1, 0.1, 0.1), True) for x in (-0.2, 0.2)]
        wall = block(*(0.5 * eye[:2]), (0.5, 0.05, 0.6), False)
        assert best_view([(hands, np.zeros((1, 3)))]) == View()
        chosen = best_view([([*hands, wall], np.zeros((1, 3)))])

        def hidden(view: View) -> float:
            """Share of rays from the hands that meet the wall, stepwise."""
            rays = np.vstack([h.points for h in hands])[:, None] + (
                np.linspace(0, 3, 500)[:, None] * view.axes[2]
            )
            inside = (rays @ wall.normals.T <= wall.offsets).all(axis=2).any(axis=1)
            return float(inside.mean())

        assert hidden(View()) > 0.5
        assert hidden(chosen) < 0.1

    def test_moves(self) -> None:
        """The joints that move most are named with how far, the farthest first."""
        solution = placed()
        words = moved_words(solution)
        found = re.findall(r"(\w+) (panda_joint\d) ([+-][\d.]+)", words)
        moves = {
            (arm, name): after - before
            for arm, names in solution.joint_names.items()
            for name, before, after in zip(
                names, solution.before.joints[arm], solution.after.joints[arm], strict=True
            )
        }
        largest = sorted(moves, key=lambda key: -abs(moves[key]))[:4]
        assert [(arm, name) for arm, name, _ in found] == largest
        assert [float(x) for *_, x in found] == [round(moves[key], 2) for key in largest]
        assert moved_words(solution.model_copy(update={"before": None})) == ""
        assert moved_words(solution.model_copy(update={"before": solution.after})) == ""


def corners_of(shape: object) -> np.ndarray:
    """Of a mesh or a box."""
    if isinstance(shape, coal.Box):
        return shape.halfSide * (2 * np.array([*np.ndindex(2, 2, 2)]) - 1)
    return shape.vertices()


def area(corners: np.ndarray) -> float:
    """Of a flat polygon."""
    return float(
        np.linalg.norm(
            sum(
                np.cross(a, b)
                for a, b in zip(
                    corners - corners[0], np.roll(corners, -1, axis=0) - corners[0], strict=True
                )
            )
        )
        / 2
    )


class TestPictures:
    """Everything is drawn without a warning; what is missing leaves a word."""

    @pytest.mark.parametrize("kind", ["png", "svg"])
    @pytest.mark.parametrize("planar", [False, True])
    def test_all(self, planar: bool, kind: str) -> None:
        solution = fully(flat() if planar else placed())
        assert picture(solution, kind) == picture(solution, kind)

    def test_words(self) -> None:
        figure = spatial_figure(panels(fully(placed(before=False))), "")
        scene = next(ax for ax in figure.axes if ax.name == "3d")
        title = scene.get_title(loc="left").splitlines()
        assert title[0].startswith("after: log-volume")
        assert title[1:] == ["nearest: 0.0123 m, left/link5 – table", NOWHERE]
        alone = flat().model_copy(update={"before": None})
        title = planar_figure(panels(alone), "").axes[0].get_title(loc="left")
        assert title.splitlines()[-1] == NOWHERE

    def test_titles_have_room(self) -> None:
        """No scene's title reaches the picture's heading."""
        for solution in (fully(flat()), fully(flat()).model_copy(update={"before": None})):
            with rc_context(LOOK.settings):
                figure = planar_figure(panels(solution), "heading")
                figure.draw_without_rendering()
            heading = figure._suptitle.get_window_extent()
            for ax in figure.axes:
                assert not heading.overlaps(ax._left_title.get_window_extent())

    @pytest.mark.parametrize("free", [False, True])
    def test_planar_scenes_have_room_for_their_words(self, free: bool) -> None:
        """Numbers and words of scenes are in the picture, and reach neither the legend, nor each
        other's frames.
        """
        solution = fully(flat()) if free else evaluate(parse(tables("paper-fig2")))
        with rc_context(LOOK.settings):
            figure = planar_figure(panels(solution), "heading")
            figure.draw_without_rendering()
        width, height = figure.bbox.size
        legend = figure.legends[0].get_window_extent()
        scenes = [ax for ax in figure.axes if ax.get_xlabel()]
        assert scenes
        for ax in scenes:
            boxes = [ax.xaxis.get_tightbbox(), ax.yaxis.get_tightbbox()]
            for box in filter(None, boxes if ax is scenes[0] else boxes[:1]):
                assert box.x0 >= 0 and box.x1 <= width and box.y0 >= 0 and box.y1 <= height
                assert not box.overlaps(legend)
                others = [other for other in scenes if other is not ax]
                assert not any(box.overlaps(other.get_window_extent()) for other in others)

    def drawn(self, solution: Solution) -> tuple[Figure, list[object]]:
        figure = cases_figure(case_rows(solution), result_heading(solution))
        return figure, figure.axes

    @pytest.mark.parametrize("planar", [False, True])
    @pytest.mark.parametrize("count", [1, 3, 6])
    def test_cases(self, planar: bool, count: int) -> None:
        solution = fully(in_cases(count, planar=planar))
        figure, axes = self.drawn(solution)
        shown = min(count, 4)
        assert len(axes) == 2 * shown
        for k, ax in enumerate(axes):
            time = solution.cases_before if k < shown else solution.cases
            case = time[k % shown]
            weight = f", weight {case.weight:g}" if k % shown else ""
            title = ax.get_title(loc="left").splitlines()
            assert title[0] == f"{case.name}{weight}"
            assert title[2] == f"nearest: {three(case.collision.distance)} m, " + (
                "left/link5 – table"
            )
        left = [round(ax.get_position().x0, 9) for ax in axes]
        assert left[:shown] == left[shown:] == sorted(set(left))
        assert axes[0].get_position().y0 > axes[-1].get_position().y1
        heading = figure._suptitle.get_text()
        assert heading.endswith("(the first 4 of 6 cases)") == (count == 6)
        rows = [text.get_text() for text in figure.texts if "Σ" in text.get_text()]
        assert [words.split(":")[0] for words in rows] == ["before", "after"]
        assert rows[1].endswith(f"= {three(solution.objective.after)}")
        assert picture(solution, "png")

    def test_cases_do_not_overlap(self) -> None:
        with rc_context(LOOK.settings):
            figure, axes = self.drawn(fully(in_cases(4, planar=True)))
            figure.draw_without_rendering()
        boxes = [ax.get_tightbbox() for ax in axes]
        for k, one in enumerate(boxes):
            assert not any(one.overlaps(other) for other in boxes[k + 1 :])
            assert not one.overlaps(figure.legends[0].get_window_extent())
            rows = [text for text in figure.texts if "Σ" in text.get_text()]
            assert not any(one.overlaps(text.get_window_extent()) for text in rows)

    @pytest.mark.parametrize("planar", [False, True])
    def test_cases_without_a_before(self, planar: bool) -> None:
        solution = fully(in_cases(before=False, planar=planar))
        figure, axes = self.drawn(solution)
        assert len(axes) == 3
        (words,) = [t.get_text() for t in figure.texts if t.get_text().startswith("after: ")]
        assert words.endswith(f"; {NOWHERE}")
        assert picture(solution, "png")

    def test_given_cases(self) -> None:
        """Were not searched: nothing is said of the file's pose."""
        (shown,) = case_rows(in_cases(before=False).model_copy(update={"search": None}))
        assert (shown.name, shown.note) == ("posture", "")

    def test_a_search_that_failed(self) -> None:
        update = {"cases": None, "status": "failed", "reason": "no luck"}
        solution = in_cases().model_copy(update=update)
        assert [words.name for words in case_rows(solution)] == ["before"]
        assert picture(solution, "png")

    def test_no_posture_at_all(self, tmp_path: Path) -> None:
        solution = in_cases().model_copy(update={"cases": None, "cases_before": None})
        with pytest.raises(copose.InputError, match="no posture to draw"):
            copose.draw(solution, tmp_path / "picture.png")


class TestComparing:
    """Totals of results with cases side by side."""

    def table(self, one: Solution, other: Solution) -> str:
        console = Console(width=120, file=io.StringIO(), highlight=False)
        console.print(comparison_table(compare(one, other)))
        return console.file.getvalue()

    @pytest.mark.parametrize("planar", [False, True])
    def test_both_have_cases(self, planar: bool, tmp_path: Path) -> None:
        one, other = fully(in_cases(planar=planar)), in_cases(2, before=False, planar=planar)
        text = self.table(one, other)
        name = "Σ weight · value"
        assert row(text, name) == ["5.500000 log", "1.750000 log"]
        assert row(text, "case case 1") == ["0.750000", "0.750000"]
        assert row(text, "case case 2") == ["1.250000", "–"]
        told = "A: case 0: nearest bodies: 0.0123 m, left/link5 – table"
        assert told in " ".join(text.split())
        assert "the postures of A are in its 3 cases\nthe postures of B are in its 2 cases" in text
        draw_comparison(compare(one, other), tmp_path / "compare.png")

    def test_one_has_cases(self, tmp_path: Path) -> None:
        text = self.table(fully(placed()), in_cases())
        assert row(text, "case case 0") == ["–", "0.250000"]
        assert "the postures of B are in its 3 cases" in text
        assert "postures of A" not in text
        draw_comparison(compare(placed(), in_cases()), tmp_path / "one.png")
        draw_comparison(compare(in_cases(), placed()), tmp_path / "two.png")

    def test_none_has(self, tmp_path: Path) -> None:
        one, other = fully(placed()), placed(before=False)
        text = self.table(one, other)
        assert "A: nearest bodies: 0.0123 m, left/link5 – table" in " ".join(text.split())
        assert "joint, rad or m" in text
        draw_comparison(compare(one, other), tmp_path / "compare.png")

    def test_no_posture(self) -> None:
        failed = in_cases().model_copy(update={"cases": None})
        with pytest.raises(copose.InputError, match="has no posture"):
            compare(in_cases(), failed)

    def test_the_command(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        files = [tmp_path / f"{name}.json" for name in "ab"]
        for file, solution in zip(files, (in_cases(), in_cases(2)), strict=True):
            file.write_text(to_json(solution))
        figure = tmp_path / "both.png"
        assert main(["compare", *map(str, files), "--figure", str(figure)]) == 0
        assert figure.exists()
        assert "are in its 3 cases" in " ".join(capsys.readouterr().out.split())
