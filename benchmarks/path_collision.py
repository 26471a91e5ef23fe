"""Paths among bodies: what keeping clear costs, and whether it is kept at every time.

    python benchmarks/path_collision.py [--paths 5] [--checked 20] [--output FILE]

Random straight carries of two Pandas and of two xArm7 among obstacles, and carries of planar arms
beside a post. Times are the processor's,
of a plan with collision over one without, by turns in one process, planners built and kernels
compiled; the least of five each. Then random straight carries of two Pandas with a box or a ball
near the way: the least distance of the bodies at 50 times in every interval between knots, asked of
coal directly on the original meshes, where Pinocchio has the links. Writes a page of Markdown.
"""

from __future__ import annotations

import argparse
import copy
import itertools
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from cases import case
from collision import obstacle, without

import copose
from copose.collision import Scene
from copose.motion import PathPlanner
from copose.results import Motion
from copose.robots import load_arms
from object_path import ObjectPath
from path_problems import gripped, hinged, three_jointed
from reference import example, pose

HERE = Path(__file__).parent
CLEARANCE = 0.01
REPEATS = 5
TIMES = 50  # in every interval
SHORT = 1e-6  # m that bodies may be nearer than the clearance


def carry(robot: str, seed: int, obstacles: int = 3, far: float = 0.15) -> dict[str, Any]:
    """Two arms, and an object that goes straight from about where the shipped problem has it."""
    rng = np.random.default_rng([seed, len(robot), 7])
    tables = copy.deepcopy(
        dict(case({"panda": "two-panda-box", "xarm7": "xarm-bar"}[robot]).tables)
    )
    middle, drawn = np.array(tables["object"]["position"]), rng.uniform(-far, far, 3)
    turn = float(rng.uniform(-0.2, 0.2))
    tables["path"] = {
        "waypoints": [
            {"position": [*(middle - drawn)], "rpy": [0.0, 0.0, -turn]},
            {"position": [*(middle + drawn)], "rpy": [0.0, 0.0, turn]},
        ],
        "duration": 2.0,
    }
    tables["obstacles"] = [obstacle(robot, k, rng) for k in range(obstacles)]
    tables["constraints"] = {"collision": True, "clearance": CLEARANCE}
    return tables


def seconds(*problems: dict[str, Any]) -> list[tuple[float, Motion]]:
    """What a plan of each takes of the processor, by turns, and the motions."""
    planners = [PathPlanner(copose.parse(tables)) for tables in problems]
    for planner in planners:
        planner.compile()
    motions = [planner.plan() for planner in planners]
    spent = [np.inf] * len(planners)
    for _ in range(REPEATS):
        for k, planner in enumerate(planners):
            began = time.process_time()
            planner.plan()
            spent[k] = min(spent[k], time.process_time() - began)
    return list(zip(spent, motions, strict=True))


def planar(tables: dict[str, Any]) -> dict[str, Any]:
    """A carry of planar arms with a post below."""
    post = {"kind": "disk", "radius": 0.05}
    return tables | {
        "obstacles": [{"name": "post", "shape": post, "position": [0.0, -0.35]}],
        "constraints": {"collision": True, "clearance": CLEARANCE},
    }


def carries(wanted: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and problems: planar ones, then random ones."""
    if wanted:
        yield "planar, hinges", planar(hinged(20))
        yield "planar, rigid", planar(gripped(20))
        yield "planar, drawn", planar(three_jointed(3))
    for number in itertools.count():
        seed, robot = number // 2, ("panda", "xarm7")[number % 2]
        yield f"{robot} {seed}", carry(robot, seed)


def measured(wanted: int) -> tuple[list[str], list[float]]:
    """Rows of the page, of planar carries and of so many others that both have a motion, and the
    ratios.
    """
    rows, ratios = [], []
    for name, tables in carries(wanted):
        if len(ratios) == (wanted + 3 if wanted else 0):
            break
        if copose.plan(copose.parse(without(tables))).status != "solved":
            continue
        if copose.plan(copose.parse(tables)).status != "solved":
            continue
        (free, blind), (spent, motion) = seconds(without(tables), tables)
        assert motion.time is not None and blind.time is not None
        ratios.append(spent / free)
        rows.append(
            f"| {name} | {len(blind.time)} | {blind.objective.after:.6f} | {free:.2f} "
            f"| {len(motion.time)} | {motion.objective.after:.6f} | {spent:.2f} "
            f"| {ratios[-1]:.1f} |"
        )
        print(rows[-1], flush=True)
    return rows, ratios


def beside(seed: int) -> dict[str, Any]:
    """A carry of two Pandas with a box or a ball near the way of an elbow."""
    rng = np.random.default_rng([seed, 11])
    tables = carry("panda", 1000 + seed, 0, 0.08)
    angle, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.4, 0.6)
    place = np.array([0.5 + away * np.cos(angle), away * np.sin(angle), rng.uniform(0.4, 0.9)])
    shape = {"kind": "sphere", "radius": float(rng.uniform(0.05, 0.1))}
    if seed % 2:
        shape = {"kind": "box", "size": rng.uniform(0.06, 0.2, 3).tolist()}
    tables["obstacles"] = [{
        "name": "obstacle", "shape": shape, "position": place.tolist(),
        "rpy": rng.uniform(-1, 1, 3).tolist(),
    }]  # fmt: skip
    return tables


class Truth:
    """Where Pinocchio has the bodies of two Pandas, an object and obstacles along a motion."""

    def __init__(self, tables: dict[str, Any]) -> None:
        """Read the robots."""
        self.tables = tables
        self.robots = []
        for arm in tables["arms"]:
            file = str(example(arm["urdf"].removeprefix("example-robot-data://")))
            model = pin.buildModelFromUrdf(file)
            # pin 4 warns where it is given folders, for it takes them for a geometry model first.
            os.environ["ROS_PACKAGE_PATH"] = str(example("").parents[1])
            shapes = pin.buildGeomFromUrdf(model, file, pin.GeometryType.COLLISION)
            self.robots.append((arm, model, shapes, model.createData(), shapes.createData()))
        # Every shape and the name of its body.
        self.shapes: list[tuple[str, Any]] = []
        for arm, model, shapes, *_ in self.robots:
            for each in shapes.geometryObjects:
                link = model.frames[each.parentFrame].name
                self.shapes.append((f"{arm['name']}/{link}", each.geometry))
        self.still = [("object", tables["object"])]
        self.still += [(each["name"], each) for each in tables.get("obstacles", [])]
        self.shapes += [(name, _shape(table["shape"])) for name, table in self.still]
        for _, shape in self.shapes:
            shape.computeLocalAABB()
        self.centres = np.array([shape.aabb_center for _, shape in self.shapes])
        self.radii = np.array([shape.aabb_radius for _, shape in self.shapes])
        problem = copose.parse(tables)
        scene = Scene.of(problem, load_arms(problem))
        names = [solid.name for solid in scene.solids]
        tested = {frozenset((names[a], names[b])) for a, b in scene.pairs}
        own = [name for name, _ in self.shapes]
        self.pairs = [
            (a, b) for a, b in itertools.combinations(range(len(own)), 2)
            if frozenset((own[a], own[b])) in tested
        ]  # fmt: skip
        assert {frozenset((own[a], own[b])) for a, b in self.pairs} == tested

    def placed(self, motion: Motion, k: int, part: float, path: ObjectPath) -> list[pin.SE3]:
        """Every shape at a part of the interval after knot k, joints cubic by their rates."""
        assert motion.time is not None and motion.knots is not None
        first, last = motion.knots[k], motion.knots[k + 1]
        step = motion.time[k + 1] - motion.time[k]
        places = []
        for arm, model, shapes, data, placed in self.robots:
            name = arm["name"]
            q, r = (np.array(knot.joints[name]) for knot in (first, last))
            v, w = (step * np.array(knot.velocity[name]) for knot in (first, last))
            u = part
            joints = (
                q * (1 + 2 * u) * (1 - u) ** 2 + r * u**2 * (3 - 2 * u)
                + v * u * (1 - u) ** 2 - w * u**2 * (1 - u)
            )  # fmt: skip
            full = pin.neutral(model)
            for joint, value in zip(motion.joint_names[name], joints, strict=True):
                full[model.joints[model.getJointId(joint)].idx_q] = value
            pin.updateGeometryPlacements(model, data, shapes, placed, full)
            places += [pose(arm.get("base", {})) * where for where in placed.oMg]
        now = path.at(motion.time[k] + part * step)
        for name, table in self.still:
            moves = name == "object"
            places.append(pin.SE3(now.rotation, now.position) if moves else pose(table))
        return places

    def least(self, motion: Motion) -> float:
        """The smallest distance that coal has at all of the times."""
        assert motion.time is not None and motion.duration is not None
        path, least = ObjectPath(self.tables, motion.duration), np.inf
        parts = np.linspace(0.0, 1.0, TIMES)
        for k, part in itertools.product(range(len(motion.time) - 1), parts):
            places = self.placed(motion, k, float(part), path)
            middles = [M * c for M, c in zip(places, self.centres, strict=True)]
            for a, b in self.pairs:
                gap = np.linalg.norm(middles[a] - middles[b]) - self.radii[a] - self.radii[b]
                if gap < least:
                    least = min(least, self._distance(a, b, places))
        return least

    def _distance(self, a: int, b: int, places: list[pin.SE3]) -> float:
        one, other = (coal.Transform3s(places[k].rotation, places[k].translation) for k in (a, b))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        return float(
            coal.distance(self.shapes[a][1], one, self.shapes[b][1], other, request, result)
        )


def _shape(table: dict[str, Any]) -> Any:
    if table["kind"] == "box":
        return coal.Box(*table["size"])
    return coal.Sphere(table["radius"])


def checked(count: int) -> tuple[list[str], int, int]:
    """Rows of the page; how many carries have a motion, and how many of them keep clear."""
    rows, moved, kept = [], 0, 0
    for seed in range(count):
        tables = beside(seed)
        motion = copose.plan(copose.parse(tables))
        if motion.time is None or motion.collision is None:
            rows.append(f"| {seed} | {motion.status} | {motion.reason} |||")
        else:
            least = Truth(tables).least(motion)
            fine = least >= max(CLEARANCE - SHORT, motion.collision - 1e-9)
            moved, kept = moved + 1, kept + fine
            rows.append(
                f"| {seed} | solved | {len(motion.time)} knots | {1e3 * motion.collision:.4f} "
                f"| {1e3 * least:.4f} | {'yes' if fine else 'NO'} |"
            )
        print(rows[-1], flush=True)
    return rows, moved, kept


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--paths", type=int, default=5, help="that are timed")
    parser.add_argument("--checked", type=int, default=20, help="that are checked")
    parser.add_argument("--output", type=Path, default=HERE / "results" / "path_collision.md")
    arguments = parser.parse_args()
    began = time.perf_counter()
    rows, ratios = measured(arguments.paths)
    checks, moved, kept = checked(arguments.checked)
    text = "\n".join([
        "# Paths among bodies", "",
        f"`python benchmarks/path_collision.py`, {time.perf_counter() - began:.0f} s. Clearance "
        f"{1e3 * CLEARANCE:g} mm; seconds of the processor, warm and compiled, the least of "
        f"{REPEATS}.", "",
        "| carry | knots, blind | objective, blind | s | knots | objective | s | ratio |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |", *rows, "",
        f"Median {np.median(ratios):.1f}, largest {max(ratios):.1f}." if ratios else "", "",
        f"Of {arguments.checked} carries beside a box or a ball {moved} have a motion; the least "
        f"distance at {TIMES} times in every interval, asked of coal, is no less than the "
        f"clearance − {SHORT:g} m and than what is reported in {kept} of them.", "",
        "| carry | status | | reported, mm | coal, mm | kept |",
        "| --- | --- | --- | ---: | ---: | --- |", *checks, "",
    ])  # fmt: skip
    arguments.output.write_text(text)
    print(f"written to {arguments.output}")


if __name__ == "__main__":
    main()
