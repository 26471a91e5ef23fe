"""Object pose, bases and grasps that may be moved, arms that are held, and cases."""

from __future__ import annotations

import copy
import functools
import json
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import copose
import reference
from cells import planar, tables, two_pandas
from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.errors import InputError
from copose.mechanics.held_object import N_PARAMETERS
from copose.poses import Pose
from copose.problem import parse
from copose.results import Solution, to_json
from reference import PlanarPlaces, moved_object, offsets, placed
from reference import Problem as Truth
from test_planning import check_posture
from test_torque_limits import farthest_of_torques

SPATIAL_BASE = ("x", "y", "z", "yaw")
GRASP = ("x", "y", "z", "twist")


def solved(cell: dict, effort: str = "normal") -> Solution:
    solution = copose.solve(parse(cell), effort=effort)
    assert solution.status == "solved", solution.reason
    return solution


def freed(cell: dict, what: str, i: int | None, **ranges: list) -> dict:
    """The cell with the object (i None), a base or a grasp free."""
    cell = copy.deepcopy(cell)
    if i is None:
        cell["object"].setdefault("freedom", {}).update(ranges)
    else:
        cell["arms"][i].setdefault("freedom", {}).setdefault(what, {}).update(ranges)
    return cell


def stuck(cell: dict) -> dict:
    """The cell with nothing free."""
    cell = copy.deepcopy(cell)
    cell["object"].pop("freedom", None)
    for arm in cell["arms"]:
        arm.pop("freedom", None)
    return cell


def found_offsets(solution: Solution, when: str = "after") -> dict[str, float]:
    return {record.name: getattr(record, when) for record in solution.freedom}


def check_places(cell: dict, solution: Solution) -> None:
    """All numbers again from joints and places; these as far from the file's as is said."""
    for when in ("before", "after"):
        posture = getattr(solution, when)
        if posture is None:
            continue
        check_posture(posture, placed(cell, posture), solution.joint_names)
        shifts: dict[tuple, dict] = {}
        for record in solution.freedom:
            *owner, name = record.name.split(".")
            value = getattr(record, when)
            assert record.lower <= value <= record.upper
            shifts.setdefault(tuple(owner), {})[name] = value
        stated = reference.pose(posture.object.model_dump())
        expected = moved_object(cell["object"], shifts.get(("object",), {}))
        assert np.allclose(stated.homogeneous, expected.homogeneous, rtol=0, atol=1e-12)
        for what in ("base", "grasp"):
            names = {a["name"] for a in cell["arms"] if a.get("freedom", {}).get(what)}
            assert set(getattr(posture, what) or {}) == names
        for arm in cell["arms"]:
            for what in ("base", "grasp"):
                if not arm.get("freedom", {}).get(what):
                    continue
                frame = getattr(posture, what)[arm["name"]].model_dump()
                expected = offsets(
                    reference.pose(arm.get(what, {})), shifts[arm["name"], what], of=what
                )
                stated = reference.pose(frame)
                assert np.allclose(stated.homogeneous, expected.homogeneous, rtol=0, atol=1e-12)


# What x means.


def everything_free() -> dict:
    cell = two_pandas()
    cell["object"]["rpy"] = [0.3, -0.4, 0.9]
    cell["arms"][0]["base"] = {"position": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, -0.3]}
    span = [-2.0, 2.0]
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    cell = freed(cell, "object", None, **dict.fromkeys(names, span))
    for i in range(2):
        cell = freed(cell, "base", i, **dict.fromkeys(SPATIAL_BASE, span))
        cell = freed(cell, "grasp", i, **dict.fromkeys(GRASP, span))
    return cell


def planar_free() -> dict:
    cell = planar(2, 4, "planar")
    span = [-2.0, 2.0]
    cell = freed(cell, "object", None, x=span, y=span, angle=span)
    cell = freed(cell, "base", 1, x=span, y=span, yaw=span)
    return freed(cell, "grasp", 0, x=span, y=span, twist=span)


@functools.cache
def ready(which: str) -> tuple[dict, Cell, Freedom, ca.Function]:
    cell = everything_free() if which == "spatial" else planar_free()
    there = Cell.of(parse(cell))
    freedom = Freedom.of(there.problem)
    x = ca.SX.sym("x", len(freedom))
    numbers = ca.SX.sym("numbers", len(freedom.numbers(there)))
    function = ca.Function("p", [x, numbers], [freedom.parameters(there.system, x, numbers)])
    return cell, there, freedom, function


@pytest.mark.parametrize("which", ["spatial", "planar"])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_places_are_what_the_tables_say(which: str, seed: int) -> None:
    """Pinocchio's compositions, the cell's poses and the program's parameters are the same."""
    cell, there, freedom, function = ready(which)
    x = np.random.default_rng(seed).uniform(freedom.lower, freedom.upper)
    moved = freedom.at(there, x)
    shifts: dict[str, dict] = {}
    for name, value in zip(freedom.names(there.problem), x, strict=True):
        owner, _, last = name.rpartition(".")
        shifts.setdefault(owner, {})[last] = value
    expected = [moved_object(cell["object"], shifts["object"])]
    poses = [moved.problem.object.pose]
    for what in ("base", "grasp"):
        for i, arm in enumerate(cell["arms"]):
            if not arm.get("freedom", {}).get(what):
                continue
            here = offsets(
                reference.pose(arm.get(what, {})), shifts[f"{arm['name']}.{what}"], of=what
            )
            expected.append(here)
            poses.append(getattr(moved.arms[i], what))
    numbers = np.array(function(x, freedom.numbers(there))).ravel()
    parts = np.split(numbers[N_PARAMETERS:], (len(numbers) - N_PARAMETERS) // 7)
    assert np.allclose(numbers[7:N_PARAMETERS], there.parameters[7:N_PARAMETERS], atol=0)
    for truth, pose, part in zip(expected, poses, [numbers[:7], *parts], strict=True):
        assert np.allclose(pose.position, truth.translation, rtol=0, atol=1e-14)
        assert np.allclose(pose.rotation, truth.rotation, rtol=0, atol=1e-14)
        turn = pin.Quaternion(*part[3:]).toRotationMatrix()
        assert np.allclose(part[:3], truth.translation, rtol=0, atol=1e-14)
        assert np.allclose(turn, truth.rotation, rtol=0, atol=1e-14)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    roll=st.floats(-4, 4),
    yaw=st.floats(-4, 4),
    side=st.sampled_from([-1.0, 1.0]),
    off=st.sampled_from([0.0, 1e-16, 1e-13, 1e-9, 1e-8, 1e-6, 1e-3, 0.5]),
)
def test_roll_pitch_yaw_near_the_gimbal_lock(roll: float, yaw: float, side: float, off: float):
    rotation = pin.rpy.rpyToMatrix(roll, side * (np.pi / 2 - off), yaw)
    turn = pin.Quaternion(rotation).coeffs()
    pose = Pose.make(np.zeros(3), rotation, [turn[3], *turn[:3]])
    assert np.allclose(pin.rpy.rpyToMatrix(*pose.rpy), rotation, rtol=0, atol=1e-13)


# Numbers of results.


def test_numbers_of_two_pandas_with_everything_free() -> None:
    """Bases, grasps and object all moved, grasps at pitch ±90°: all numbers by Pinocchio."""
    cell = two_pandas()
    cell["ellipsoid"] = {"gravity": True, "torque_scaling": "limits"}
    cell = freed(cell, "object", None, z=[0.02, 0.1], pitch=[-0.3, -0.1])
    cell = freed(cell, "base", 1, x=[-0.1, 0.1], yaw=[0.1, 0.4])
    cell = freed(cell, "grasp", 0, z=[-0.05, 0.05], twist=[-0.4, 0.4])
    solution = solved(cell, "low")
    check_places(cell, solution)
    assert solution.before.base.keys() == {"right"} and solution.before.grasp.keys() == {"left"}
    before = found_offsets(solution, "before")
    assert before["object.z"] == 0.02 and before["object.pitch"] == -0.1
    assert before["right.base.yaw"] == 0.1 and before["left.grasp.twist"] == 0.0
    assert solution.objective.after > solution.objective.before


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("what", "ranges"),
    [
        ("object", {"x": [-0.1, 0.1], "y": [-0.1, 0.1], "angle": [-0.4, 0.4]}),
        ("base", {"x": [-0.15, 0.15], "y": [-0.15, 0.15], "yaw": [-0.5, 0.5]}),
        ("grasp", {"x": [-0.05, 0.05], "y": [-0.1, 0.1], "twist": [-0.5, 0.5]}),
    ],
    ids=["object", "base", "grasp"],
)
def test_never_below_the_given_pose(what: str, ranges: dict, seed: int) -> None:
    space, links = (("planar", 3), ("planar-linear", 3), ("planar", 4))[seed]
    cell = random_planar(seed, space, links)
    given_pose = solved(cell)
    cell = freed(cell, what, None if what == "object" else 1, **ranges)
    solution = solved(cell, "low")
    assert solution.objective.after >= given_pose.objective.after - 1e-9
    # What was before stays so: the file's pose lies within the ranges.
    assert solution.objective.before == pytest.approx(given_pose.objective.before, rel=1e-12)
    check_places(cell, solution)


def random_planar(seed: int, space: str, links: int) -> dict:
    """Two arms of random links round a plate."""
    rng = np.random.default_rng([seed, links, len(space)])
    cell = planar(2, links, space)
    for i, arm in enumerate(cell["arms"]):
        turn = np.pi * (1 + i) + rng.uniform(-0.5, 0.5)
        out = np.array([np.cos(turn), np.sin(turn)])
        for link in arm["links"]:
            length = float(rng.uniform(0.3, 0.45))
            link |= {"length": length, "com": 0.6 * length, "mass": float(rng.uniform(0.4, 2))}
        arm["links"][-1] |= {"length": 0.2, "com": 0.1} if space == "planar" else {}
        arm["base"] = {"position": (0.6 * out).tolist(), "angle": float(rng.uniform(-3, 3))}
        arm["grasp"]["angle"] = float(turn + np.pi + rng.uniform(-0.4, 0.4))
    cell["object"] |= {"mass": float(rng.uniform(0.3, 3)), "angle": float(rng.uniform(-0.4, 0.4))}
    return cell


GRIDS = {
    "object x y of two 3R arms on hinges": (
        (5, "planar-linear", 3),
        [("object", None, {"x": [-0.15, 0.15], "y": [-0.15, 0.15]})],
    ),
    "object x angle of two 4R arms": (
        (2, "planar", 4),
        [("object", None, {"x": [-0.15, 0.15], "angle": [-0.6, 0.6]})],
    ),
    "base x y of a 3R arm": (
        (3, "planar", 3),
        [("base", 1, {"x": [-0.2, 0.2], "y": [0.05, 0.3]})],
    ),
    "grasps of two 4R arms": (
        (4, "planar", 4),
        [("grasp", 0, {"y": [-0.1, 0.1]}), ("grasp", 1, {"twist": [-0.6, 0.6]})],
    ),
    "base and object of two 3R arms": (
        (6, "planar", 3),
        [("base", 0, {"y": [-0.25, 0.25]}), ("object", None, {"angle": [-0.8, 0.8]})],
    ),
    "grasp and base on hinges, within limits": (
        (7, "planar-linear", 3),
        [("grasp", 0, {"x": [-0.05, 0.1]}), ("base", 1, {"x": [-0.2, 0.2]})],
    ),
}


@pytest.mark.few(3)
@pytest.mark.parametrize("name", list(GRIDS))
def test_a_dense_grid_finds_nothing_better(name: str) -> None:
    """All that is free and all self-motions on a grid, the best polished by SciPy's SLSQP."""
    drawn, free = GRIDS[name]
    cell = random_planar(*drawn)
    if "limits" in name:
        for arm in cell["arms"]:
            arm["position_limits"] = [[-2.6, 2.6]] * 3
    for what, i, ranges in free:
        cell = freed(cell, what, i, **ranges)
    solution = solved(cell)
    places = PlanarPlaces(cell)
    redundant = drawn[1:] != ("planar", 3)
    starts = places.densest(*((13, 60, 8) if redundant else (41, 0, 8)))
    best = max(places.polished(q, x)[0] for q, x in starts)
    assert solution.objective.after == pytest.approx(best, abs=1e-4)
    check_places(cell, solution)
    q = np.concatenate([solution.after.joints[arm["name"]] for arm in cell["arms"]])
    order = [
        f"{'object' if i is None else cell['arms'][i]['name'] + '.' + what}.{given}"
        for i, what, name, _ in places.free
        for given in ((name,) if i is None or name != "angle" else ("yaw", "twist"))
    ]
    at = found_offsets(solution)
    x = np.array([at[key] for key in order if key in at])
    assert places.value(q[None], x[None])[0] == pytest.approx(solution.objective.after, abs=1e-9)


def test_a_flat_range_is_the_given_pose() -> None:
    """Hardly any freedom: hardly any other answer."""
    cell = random_planar(1, "planar", 4)
    near = freed(cell, "object", None, x=[-1e-9, 1e-9])
    near = freed(near, "base", 0, y=[0.0, 1e-9])
    assert solved(near).objective.after == pytest.approx(solved(cell).objective.after, abs=1e-6)


# Before.


def test_before_is_at_the_pose_clipped_into_the_range() -> None:
    cell = random_planar(0, "planar", 4)
    away = freed(cell, "object", None, x=[0.05, 0.1], y=[-0.08, -0.02])
    away = freed(away, "grasp", 1, twist=[-0.3, -0.2])
    solution = solved(away, "low")
    there = copy.deepcopy(cell)
    x, y = cell["object"]["position"]
    there["object"]["position"] = [x + 0.05, y - 0.02]
    there["arms"][1]["grasp"]["angle"] -= 0.2
    assert solution.objective.before == pytest.approx(solved(there).objective.before, rel=1e-9)
    assert found_offsets(solution, "before") == {
        "object.x": 0.05, "object.y": -0.02, "a2.grasp.twist": -0.2,
    }  # fmt: skip
    check_places(away, solution)


def test_no_before_where_the_given_pose_is_out_of_reach() -> None:
    cell = random_planar(0, "planar", 4)
    cell["object"]["position"] = [3.0, 0.1]
    cell = freed(cell, "object", None, x=[-3.2, 0.0])
    solution = solved(cell, "low")
    assert solution.before is None and solution.objective.before is None
    assert any("file's pose" in note for note in solution.notes)
    assert [record.before for record in solution.freedom] == [None]
    check_places(cell, solution)


def test_infeasible_everywhere_names_the_arm() -> None:
    cell = random_planar(0, "planar", 3)
    cell["arms"][1]["base"]["position"] = [4.0, 0.0]
    cell = freed(cell, "object", None, x=[-0.3, 0.3], y=[-0.3, 0.3])
    solution = copose.solve(parse(cell), effort="low")
    assert solution.status == "infeasible" and solution.after is None and solution.before is None
    assert "'a2'" in solution.reason and "'a1'" not in solution.reason
    miss = solution.nearest_miss
    gap = Truth(placed(cell, miss)).at(miss.joints).closure["a2"]
    assert miss.closure_error["a2"] == pytest.approx(gap, abs=1e-9)
    assert f"{gap:.4g} m" in solution.reason


# Fixed arms.


def held(cell: dict, i: int, seed: int = 0) -> dict:
    """The cell with arm i held where it holds the object."""
    cell = copy.deepcopy(cell)
    joints = solved(stuck(cell) | {"search": {"seed": seed}}).before.joints
    cell["arms"][i] |= {"fixed": True, "start": list(joints[cell["arms"][i]["name"]])}
    return cell


@pytest.mark.parametrize(("space", "links"), [("planar", 4), ("planar-linear", 3)])
def test_a_fixed_arm_stays_at_its_start(space: str, links: int) -> None:
    cell = held(random_planar(2, space, links), 0)
    start = tuple(cell["arms"][0]["start"])
    solution = solved(cell)
    assert solution.after.joints["a1"] == start == solution.before.joints["a1"]
    unheld = copy.deepcopy(cell)
    del unheld["arms"][0]["fixed"]
    assert solution.objective.after <= solved(unheld).objective.after + 1e-9
    assert solution.objective.after > solution.objective.before
    cell = freed(cell, "base", 1, x=[-0.1, 0.1])
    moved = solved(cell, "low")
    assert moved.after.joints["a1"] == start
    assert moved.objective.after >= solution.objective.after - 1e-9
    check_places(cell, moved)


def arms_to_spare(held_links: int, moving_links: int) -> dict:
    """A rigid grasp, the first arm held, the second anywhere; both with joints to spare or none."""
    cell = random_planar(5, "planar", 5)
    for arm, count in zip(cell["arms"], (held_links, moving_links), strict=True):
        arm["links"] = [dict(link, length=0.4, com=0.2) for link in arm["links"][:count]]
        arm["links"][-1] |= {"length": 0.2, "com": 0.1}
    return held(cell, 0)


def closed_postures(cell: dict, i: int, count: int) -> np.ndarray:
    """Random postures of arm i that hold the object, by the closed form of its last three joints.

    Its links are 0.4 m long, the last one 0.2 m.
    """
    arm, rng = cell["arms"][i], np.random.default_rng(0)
    goal = reference.pose(cell["object"]) * reference.pose(arm["grasp"])
    tip = np.arctan2(goal.rotation[1, 0], goal.rotation[0, 0])
    wrist = goal.translation[:2] - 0.2 * np.array([np.cos(tip), np.sin(tip)])
    free = rng.uniform(-np.pi, np.pi, (count, len(arm["links"]) - 3))
    turned = arm["base"]["angle"] + np.cumsum(free, axis=1)
    place = np.array(arm["base"]["position"]) + 0.4 * np.stack(
        [np.cos(turned).sum(axis=1), np.sin(turned).sum(axis=1)], axis=1
    )
    angle = turned[:, -1] if turned.shape[1] else np.full(count, arm["base"]["angle"])
    x, y = (wrist - place).T
    elbow = np.arccos((x**2 + y**2) / (2 * 0.4**2) - 1) * rng.choice([-1, 1], count)
    shoulder = np.arctan2(y, x) - elbow / 2 - angle
    return np.column_stack([free, shoulder, elbow, tip - angle - shoulder - elbow])


@pytest.mark.parametrize("held_links", [3, 4, 5])
@pytest.mark.parametrize("moving_links", [3, 4, 5])
@pytest.mark.filterwarnings("ignore:invalid value encountered in arccos")
def test_a_fixed_arm_beside_one_that_moves(held_links: int, moving_links: int) -> None:
    cell = arms_to_spare(held_links, moving_links)
    truth = Truth(cell)
    start = cell["arms"][0]["start"]
    postures = closed_postures(cell, 1, 400)
    values = []
    for q in postures[np.isfinite(postures).all(axis=1)]:
        there = truth.at({"a1": start, "a2": q})
        assert max(there.closure.values()) <= 1e-8
        values.append(-0.5 * np.linalg.slogdet(there.gram)[1] + np.log(4 * np.pi / 3))
    solution = solved(cell)
    assert solution.after.joints["a1"] == tuple(start)
    assert solution.objective.after >= max(values) - 1e-9
    if moving_links == 3:
        assert solution.objective.after == pytest.approx(max(values), abs=1e-7)


def test_a_fixed_arm_is_the_same_to_compiled_kernels(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    problem = parse(arms_to_spare(4, 5))
    expected = copose.solve(problem)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("COPOSE_COMPILE", "1")
    planner = copose.Planner(problem)
    assert planner.compile()
    solution = planner.solve()
    assert (solution.after, solution.search) == (expected.after, expected.search)


@pytest.mark.parametrize(
    "kind", ["volume", "worst-direction", "isotropy", "velocity-volume", "acceleration", "payload"]
)
def test_arms_that_are_all_fixed(kind: str) -> None:
    """The answer is the posture itself."""
    cell = arms_to_spare(4, 3)
    start = solved(stuck(cell), "low").before.joints["a2"]
    cell["arms"][1] |= {"fixed": True, "start": list(start)}
    cell["world"] = {"gravity": [0.0, -9.81]}
    for arm in cell["arms"]:
        arm["torque_limits"] = [100.0] * len(arm["links"])
    direction = {"direction": [1.0, 0.0, 0.0]} if kind == "acceleration" else {}
    cell["objective"] = {"kind": kind} | direction
    solution, given_posture = solved(cell), copose.evaluate(parse(cell))
    assert solution.after.joints == solution.before.joints == given_posture.after.joints
    assert solution.objective.after == solution.objective.before == given_posture.objective.after


def test_a_fixed_arm_that_misses_its_grasp() -> None:
    cell = held(random_planar(2, "planar", 4), 0)
    cell["arms"][0]["start"][0] += 0.1
    tip = Truth(cell).arms["a1"].at(cell["arms"][0]["start"])[0]
    goal = Truth(cell).object * reference.pose(cell["arms"][0]["grasp"])
    gap = np.linalg.norm(tip.translation - goal.translation)
    for free in (cell, freed(cell, "base", 1, x=[-0.1, 0.1])):
        solution = copose.solve(parse(free), effort="low")
        assert solution.status == "infeasible"
        assert "'a1'" in solution.reason and f"{gap:.4g} m" in solution.reason


@pytest.mark.parametrize("space", ["planar", "planar-linear"])
def test_the_object_goes_where_a_fixed_arm_holds_it(space: str) -> None:
    """The arm is turned at its shoulder; the object follows, a grasp that slides free to."""
    cell = held(random_planar(3, space, 4), 0)
    cell["arms"][0]["start"][0] += 0.15
    start = tuple(cell["arms"][0]["start"])
    cell = freed(cell, "object", None, x=[-0.5, 0.5], y=[-0.5, 0.5], angle=[-0.5, 0.5])
    cell = freed(cell, "grasp", 0, y=[-0.05, 0.05])
    solution = solved(cell, "low")
    assert solution.after.joints["a1"] == start
    tip = Truth(cell).arms["a1"].at(start)[0]
    object_ = reference.pose(solution.after.object.model_dump())
    grasp = object_ * reference.pose(solution.after.grasp["a1"].model_dump())
    assert np.linalg.norm(tip.translation - grasp.translation) <= 1e-8
    if space == "planar":
        assert np.linalg.norm(tip.rotation - grasp.rotation) <= 1e-8
    check_places(cell, solution)


def test_a_fixed_arm_in_every_case() -> None:
    """Each case's object goes where the arm holds it, from a pose of its own."""
    cell = held(random_planar(3, "planar", 4), 0)
    x, y = cell["object"]["position"]
    cell = freed(cell, "object", None, x=[-0.3, 0.3], y=[-0.3, 0.3])
    cell["cases"] = [{"name": "here"}, {"name": "there", "position": [x + 0.1, y - 0.05]}]
    solution = solved(cell, "low")
    for posture in solution.cases:
        assert posture.object.position == pytest.approx((x, y), abs=1e-8)


# Cases.


def with_cases() -> dict:
    cell = random_planar(4, "planar", 4)
    cell = freed(cell, "base", 1, x=[-0.15, 0.15], y=[-0.15, 0.15])
    cell = freed(cell, "grasp", 0, y=[-0.05, 0.05])
    x, y = cell["object"]["position"]
    cell["objective"] = {
        "kind": "task-compatibility",
        "directions": [{"direction": [1.0, 0.0, 0.0]}],
    }
    cell["cases"] = [
        {"name": "low", "position": [x, y - 0.1], "weight": 2.0},
        {"name": "heavy", "mass": 4.0, "direction": [0.0, 1.0, 0.0]},
        {"name": "turned", "angle": 0.5, "weight": 0.5, "direction": [0.0, 0.0, 1.0]},
    ]
    return cell


def test_one_placement_serves_all_cases() -> None:
    cell = with_cases()
    solution = solved(cell, "low")
    assert solution.after is None and solution.before is None
    assert [case.name for case in solution.cases] == ["low", "heavy", "turned"]
    for cases, total in (
        (solution.cases_before, solution.objective.before),
        (solution.cases, solution.objective.after),
    ):
        assert total == pytest.approx(sum(c.weight * c.objective for c in cases), abs=1e-12)
        assert {case.base["a2"] for case in cases} == {cases[0].base["a2"]}
        assert {case.grasp["a1"] for case in cases} == {cases[0].grasp["a1"]}
    assert solution.objective.after > solution.objective.before
    for case, posture in zip(cell["cases"], solution.cases, strict=True):
        assert posture.weight == case.get("weight", 1.0)
        where = placed(cell, posture, case)
        if "mass" in case:
            ratio = case["mass"] / cell["object"]["mass"]
            assert where["object"]["inertia"] == pytest.approx(ratio * cell["object"]["inertia"])
        check_posture(posture, where, solution.joint_names)
        # Its value by independent code, along its own direction.
        u = np.array(case.get("direction", [1.0, 0.0, 0.0]))
        factor, _ = Truth(where).ellipsoid(posture.joints)
        assert posture.objective == pytest.approx(-np.log(np.linalg.norm(factor @ u)), abs=1e-8)
        place = case.get("position", cell["object"]["position"])
        assert posture.object.position == pytest.approx(place, abs=1e-12)
        # What the case would be worth alone, with base and grasp where they were found.
        where["objective"]["directions"] = [{"direction": u.tolist()}]
        planner = copose.Planner(copose.parse(where))
        alone = max(planner.solve(seed=seed).objective.after for seed in range(4))
        assert posture.objective >= alone - 1e-6
        assert posture.objective == pytest.approx(alone, abs=1e-6)


@pytest.mark.parametrize("free", [False, True])
def test_one_case_alone_is_the_plain_problem(free: bool) -> None:
    cell = random_planar(5, "planar", 4)
    if free:
        cell = freed(cell, "base", 0, x=[-0.1, 0.1])
        cell = freed(cell, "object", None, y=[-0.1, 0.1])
    x, y = cell["object"]["position"]
    cases = copy.deepcopy(cell) | {"cases": [{"name": "only", "position": [x + 0.05, y]}]}
    cell["object"]["position"] = [x + 0.05, y]
    one, plain = solved(cases), solved(cell)
    assert one.objective.after == pytest.approx(plain.objective.after, abs=1e-8)
    assert one.cases[0].objective == one.objective.after
    if free:
        ends = [record.after for record in one.freedom]
        assert ends == pytest.approx([record.after for record in plain.freedom], abs=1e-5)
        assert one.freedom[0].name == "only: object.y"


def test_the_object_moves_for_each_case_and_bases_for_all() -> None:
    cell = with_cases()
    cell = freed(cell, "object", None, x=[-0.1, 0.1])
    solution = solved(cell, "low")
    at = found_offsets(solution)
    names = ["low: object.x", "heavy: object.x", "turned: object.x"]
    assert list(at) == [*names, "a1.grasp.y", "a2.base.x", "a2.base.y"]
    assert len({at[name] for name in names}) == 3
    for case, posture in zip(cell["cases"], solution.cases, strict=True):
        x = case.get("position", cell["object"]["position"])[0]
        assert posture.object.position[0] == pytest.approx(x + at[f"{case['name']}: object.x"])
        check_posture(posture, placed(cell, posture, case), solution.joint_names)


def test_evaluate_refuses_cases_that_share_what_is_free() -> None:
    """One posture at one placement is no answer to them: one line says so, and no traceback."""
    cell = with_cases()
    alone = stuck(cell)
    del alone["cases"]
    held = solved(alone, "low").after.joints
    with pytest.raises(InputError, match=r"^cases: and freedom ask for several postures"):
        copose.evaluate(parse(cell), held)
    for rest in (stuck(cell), {key: cell[key] for key in cell if key != "cases"}):
        assert copose.evaluate(parse(rest), held).status == "solved"


# Repeatable.


@pytest.mark.parametrize("cases", [False, True])
def test_one_seed_one_answer(cases: bool) -> None:
    cell = with_cases()
    cell["cases"] = cell["cases"][: 2 * cases]

    def run(seed: int) -> dict:
        answer = json.loads(to_json(solved(cell | {"search": {"seed": seed}}, "low")))
        del answer["timing"]
        return answer

    first = run(5)
    assert first == run(5)
    assert cases or first != run(6)


# Torque limits.


@functools.cache
def spun() -> tuple[dict, Solution]:
    cell = two_pandas()
    cell["object"]["inertia"] = [0.02, 0.06, 0.05]
    cell["objective"] = {"kind": "acceleration", "direction": [0, 0, 0, 0.3, 0, 1]}
    cell = freed(cell, "object", None, roll=[-0.3, 0.5], yaw=[-0.4, 0.4])
    return cell, solved(cell, "low")


def test_angular_acceleration_is_its_linear_program() -> None:
    cell, solution = spun()
    u = np.array([0, 0, 0, 0.3, 0, 1]) / np.hypot(0.3, 1)
    for posture, value in (
        (solution.before, solution.objective.before),
        (solution.after, solution.objective.after),
    ):
        where = placed(cell, posture)
        truth = Truth(where, {name: list(j) for name, j in solution.joint_names.items()})
        weight = truth.at_rest(posture.joints)[-1]
        expected = farthest_of_torques(truth, posture.joints, 0 * u, u, weight, truth.M_o @ u)
        assert value == pytest.approx(expected, rel=1e-7)
        check_posture(posture, where, solution.joint_names)


def test_no_small_move_is_better() -> None:
    """The object moved a little either way, the posture polished again there."""
    cell, solution = spun()
    planner = copose.Planner(parse(stuck(cell)))
    at, value = found_offsets(solution), solution.objective.after
    position = cell["object"]["position"]
    moves = [{k: s} for k in ("roll", "yaw") for s in (-3e-3, 3e-3, -3e-4, 3e-4)]
    tried = 0
    for move in moves:
        shift = {k: at[f"object.{k}"] + move.get(k, 0.0) for k in ("roll", "yaw")}
        if any(
            not cell["object"]["freedom"][k][0] <= v <= cell["object"]["freedom"][k][1]
            for k, v in shift.items()
        ):
            continue
        tried += 1
        place = {"position": position, "rpy": [shift["roll"], 0.0, shift["yaw"]]}
        end = planner.polish(solution.after.joints, object_pose=place)
        assert end.objective <= value * (1 + 1e-6)
        # And it is a neighbour: nothing has been polished away.
        assert end.objective > 0.9 * value
    assert tried >= 4


def test_torque_limits_in_cases() -> None:
    """Mass, angle and direction of each case enter its linear program."""
    cell = random_planar(4, "planar", 3)
    cell["world"] = {"gravity": [0.0, -9.81]}
    for arm in cell["arms"]:
        arm["torque_limits"] = [40.0, 30.0, 15.0]
    cell["objective"] = {"kind": "acceleration", "direction": [0.0, 1.0, 0.0]}
    cell = freed(cell, "base", 1, x=[-0.1, 0.1])
    cell["cases"] = [
        {"name": "light"},
        {"name": "heavy", "mass": 4.0, "angle": 0.3, "direction": [1.0, 0.0, 0.5], "weight": 0.5},
    ]
    solution = solved(cell, "low")
    for case, posture in zip(cell["cases"], solution.cases, strict=True):
        where = placed(cell, posture, case)
        u = np.array(case.get("direction", [0.0, 1.0, 0.0]))
        u /= np.linalg.norm(u)
        truth = Truth(where)
        weight = truth.at_rest(posture.joints)[-1]
        expected = farthest_of_torques(truth, posture.joints, 0 * u, u, weight, truth.M_o @ u)
        assert posture.objective == pytest.approx(expected, rel=1e-7)
        check_posture(posture, where, solution.joint_names)
    assert solution.objective.after > solution.objective.before


# What is refused.


@pytest.mark.parametrize("side", [0, 1])
def test_one_robot_has_one_base(side: int) -> None:
    cell = freed(tables("baxter-box"), "base", side, x=[-0.1, 0.1])
    with pytest.raises(InputError, match=r"arms\[1\] \(right\)\.freedom\.base: .*one robot"):
        copose.check(parse(cell))
    copose.check(parse(freed(tables("baxter-box"), "grasp", side, x=[-0.1, 0.1])))


def test_an_angle_has_one_name_at_a_time() -> None:
    for what, name in (("base", "yaw"), ("grasp", "twist")):
        one = freed(planar(2, 4, "planar"), what, 0, angle=[-0.1, 0.2])
        other = freed(planar(2, 4, "planar"), what, 0, **{name: [-0.1, 0.2]})
        assert parse(one).arms[0].freedom == parse(other).arms[0].freedom
        both = freed(one, what, 0, **{name: [-0.3, 0.3]})
        with pytest.raises(InputError, match="freedom"):
            parse(both)


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({"name": "a", "mass": 0.0}, r"cases\[0\]\.mass"),
        ({"name": "a", "weight": -1.0}, r"cases\[0\]\.weight"),
        ({"name": "a", "rpy": [0, 0, 0]}, r"cases\[0\]\.rpy"),
        ({"mass": 1.0}, r"cases\[0\]\.name"),
        ({"name": "a", "direction": [1, 0]}, r"cases\[0\]\.direction"),
        ({"name": "a", "direction": [0, 0, 0]}, r"cases\[0\]\.direction"),
    ],
    ids=str,
)
def test_faults_of_cases(case: dict, expected: str) -> None:
    cell = with_cases() | {"cases": [case]}
    with pytest.raises(InputError, match=expected):
        parse(cell)
