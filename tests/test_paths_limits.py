"""Motions within torque limits, and what is said where there are none."""

from __future__ import annotations

import copy
import re

import numpy as np
import pytest

import copose
import path_problems
from cells import planar
from copose.cell.cell import Cell
from copose.motion.curve.hermite import closed_at
from copose.motion.curve.straight_motion import straightened
from copose.motion.dynamics.rates import JointRates
from copose.motion.path.knots import Course, uniform
from copose.motion.path.request import asked
from copose.posture.model import PostureModel
from object_path import ObjectPath

LENGTH, MASS, INERTIA, GRAVITY, LOAD = 0.4, 1.0, 0.03, 9.81, 0.5
LIMITS = np.array([20.0, 8.0])


def with_limits(cell: dict, *limits: float, **constraints: bool) -> dict:
    """The same where every arm has torque limits that are to be kept."""
    limited = copy.deepcopy(cell)
    for arm in limited["arms"]:
        arm["torque_limits"] = list(limits)
    return limited | {"constraints": constraints}


def two_jointed(**settings: object) -> dict:
    """An arm without a degree of freedom to spare carries a point mass."""
    cell = planar(1)
    cell["object"] |= {"mass": LOAD}
    link = {"length": LENGTH, "mass": MASS, "inertia": INERTIA, "com": LENGTH / 2}
    cell["arms"][0] |= {
        "links": [link, link],
        "base": {"position": [0.0, 0.0]},
        "grasp": {"position": [0.0, 0.0]},
    }
    return path_problems.along(
        cell | {"world": {"gravity": [0.0, -GRAVITY]}},
        {"position": [0.5, 0.0]}, {"position": [0.4, 0.4]}, **settings,
    )  # fmt: skip


def torques_of_two_joints(cell: dict, duration: float, elbow: float) -> np.ndarray:
    """By Lagrange's equations of two links and a point mass, at 400 instants, (400, 2)."""
    path, half = ObjectPath(cell, duration), LENGTH / 2
    found = []
    for time in np.linspace(0.0, duration, 400):
        now = path.at(time)
        x, y = now.position[:2]
        c2 = (x * x + y * y) / (2 * LENGTH**2) - 1
        q2 = elbow * np.arccos(c2)
        q1 = np.arctan2(y, x) - q2 / 2
        s, c = np.array([np.sin(q1), np.sin(q1 + q2)]), np.array([np.cos(q1), np.cos(q1 + q2)])
        J = LENGTH * np.array([[-s[0] - s[1], -s[1]], [c[0] + c[1], c[1]]])
        v = np.linalg.solve(J, now.velocity[:2])
        w = np.cumsum(v)
        bend = -LENGTH * np.array([c @ w**2, s @ w**2])
        a = np.linalg.solve(J, now.acceleration[:2] - bend)
        # One link's mass beyond the elbow together with the load's.
        far, inner = MASS * half + LOAD * LENGTH, MASS * half**2 + INERTIA
        outer = inner + LOAD * LENGTH**2
        m22 = outer
        m12 = outer + LENGTH * far * np.cos(q2)
        m11 = inner + (MASS + LOAD) * LENGTH**2 + outer + 2 * LENGTH * far * np.cos(q2)
        M = np.array([[m11, m12], [m12, m22]])
        h = LENGTH * far * np.sin(q2)
        coriolis = np.array([-h * (2 * v[0] * v[1] + v[1] ** 2), h * v[0] ** 2])
        g2 = GRAVITY * far * c[1]
        g1 = GRAVITY * (MASS * half + (MASS + LOAD) * LENGTH) * c[0] + g2
        found.append(M @ a + coriolis + [g1, g2])
    return np.array(found)


def test_the_shortest_duration_of_an_arm_without_choice_is_what_torques_allow() -> None:
    cell = with_limits(two_jointed(duration="shortest"), *LIMITS, dynamic_torque=True)
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "solved", motion.reason
    shortest = []
    for elbow in (-1.0, 1.0):
        low, high = 0.05, 5.0
        while high - low > 1e-4:
            middle = (low + high) / 2
            torque = torques_of_two_joints(cell, middle, elbow)
            low, high = (low, middle) if np.all(np.abs(torque) <= LIMITS) else (middle, high)
        shortest.append(high)
    assert motion.duration == pytest.approx(min(shortest), rel=0.01)
    torque = np.array([knot.torque["a1"] for knot in motion.knots])
    assert 0.98 < (np.abs(torque) / LIMITS).max() <= 1 + 1e-6


@pytest.mark.few(1)
@pytest.mark.parametrize("part", [1.0, 0.5, 0.4])
def test_the_shortest_motion_may_be_one_that_torques_alone_limit(part: float) -> None:
    cell = path_problems.hinged(duration="shortest")
    limits = [part * T for T in (20.0, 15.0, 8.0)]
    motion = copose.plan(copose.parse(with_limits(cell, *limits, dynamic_torque=True)))
    assert motion.status == "solved", motion.reason
    shares = np.array([[knot.torque[a] for a in ("a1", "a2")] for knot in motion.knots]) / limits
    assert 0.98 < np.abs(shares).max() <= 1 + 1e-6


@pytest.mark.parametrize(
    ("build", "factors"),
    [(two_jointed, (1e-3, 1e3, 1e6)), (lambda: path_problems.hinged(10), (1e6,))],
    ids=["two joints", "hinged"],
)
def test_the_shortest_motion_does_not_depend_on_the_unit_of_torques(build, factors) -> None:
    cell = build() | {"world": {"gravity": [0.0, 0.0]}}
    cell["path"]["duration"] = "shortest"
    limits = [2.0] * len(cell["arms"][0]["links"])
    first = copose.plan(copose.parse(with_limits(cell, *limits)))
    for factor in factors:
        motion = copose.plan(copose.parse(with_limits(cell, *(factor * T for T in limits))))
        assert motion.status == "solved", motion.reason
        assert motion.duration * np.sqrt(factor) == pytest.approx(first.duration, rel=1e-6)
        for knot, other in zip(motion.knots, first.knots, strict=True):
            for name in knot.joints:
                assert knot.joints[name] == pytest.approx(other.joints[name], abs=1e-5)


@pytest.mark.parametrize(
    ("part", "constraint", "status", "words"),
    [
        (
            0.35,
            "static_torque",
            "infeasible",
            [" s: no posture holds the object at rest", "a1/joint2", "1.15"],
        ),
        (0.2, "static_torque", "infeasible", [" s: no posture holds the object at rest"]),
        pytest.param(
            0.3,
            "dynamic_torque",
            "failed",
            ["arm 'a1', ", "'joint2' needs 1.298 times its torque limit"],
            marks=pytest.mark.long,
        ),
    ],
)
def test_torque_limits_that_are_too_small_are_named(
    part: float, constraint: str, status: str, words: list[str]
) -> None:
    limits = [part * T for T in (20.0, 15.0, 8.0)]
    cell = with_limits(path_problems.hinged(), *limits, **{constraint: True})
    motion = copose.plan(copose.parse(cell))
    # Arms that may choose otherwise might spare more: no search is a proof of what moves.
    assert motion.status == status
    assert motion.reason is not None
    assert motion.reason.endswith("(torque)")
    assert all(word in motion.reason for word in words), motion.reason


def test_acceleration_limits_that_are_too_small_are_named() -> None:
    cell = path_problems.hinged()
    for arm in cell["arms"]:
        arm["acceleration_limits"] = [0.1] * 3
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "infeasible"
    assert motion.reason is not None
    assert motion.reason.endswith("s is too short (acceleration)")


def test_what_programs_miss_by_little_is_not_called_infeasible() -> None:
    limits = [0.385 * T for T in (20.0, 15.0, 8.0)]
    cell = with_limits(path_problems.hinged(), *limits, dynamic_torque=True)
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "failed"
    assert motion.reason is not None and motion.reason.startswith("arm 'a1', ")
    words = r"'joint2' needs 1\.0\d\d times its torque limit \(torque\)$"
    assert re.search(words, motion.reason), motion.reason


@pytest.mark.parametrize(
    ("grasp", "turn", "constraint"),
    [
        ([0.05, 0.0], 0.0, "static_torque"),
        ([0.05, 0.0], 0.0, "dynamic_torque"),
        ([0.0, 0.0], 0.6, "dynamic_torque"),
    ],
)
def test_one_hinge_does_not_carry_what_has_to_be_turned(
    grasp: list[float], turn: float, constraint: str
) -> None:
    cell = with_limits(two_jointed(), 200.0, 200.0, **{constraint: True})
    cell["arms"][0]["grasp"]["position"] = grasp
    cell["path"]["waypoints"][1]["angle"] = turn
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "infeasible"
    assert motion.reason is not None
    assert "the contacts cannot carry the object" in motion.reason
    cell["constraints"] = {"static_torque": True}
    cell["world"]["gravity"] = [0.0, 0.0]
    assert copose.plan(copose.parse(cell)).status == "solved"


@pytest.mark.few(1)
@pytest.mark.parametrize("aggregate", ["mean", "worst"])
@pytest.mark.parametrize("name", ["hinged", "gripped"])
def test_a_calm_motion_shows_what_acceleration_limits_allow(name: str, aggregate: str) -> None:
    cell = getattr(path_problems, name)(16, duration=0.8, aggregate=aggregate, smoothness=100.0)
    calm = copose.plan(copose.parse(cell))
    assert calm.status == "solved"
    for arm in cell["arms"]:
        used = np.abs([knot.acceleration[arm["name"]] for knot in calm.knots]).max(axis=0)
        arm["acceleration_limits"] = (1.03 * used).tolist()
    cell["path"]["smoothness"] = 0.0
    motion = copose.plan(copose.parse(cell))
    assert motion.status == "solved", motion.reason
    assert motion.objective.after >= calm.objective.after


def test_the_least_duration_of_a_motion_is_where_its_largest_share_is_one() -> None:
    problem = copose.parse(
        with_limits(path_problems.hinged(), 20.0, 15.0, 8.0, dynamic_torque=True)
    )
    model = PostureModel(Cell.of(problem))
    journey = asked(problem, problem.path, model.cell.arms)
    drive, course = JointRates(model, journey, 1e-4), Course.of(model, journey, uniform(25))
    motion = copose.plan(problem)
    q = [np.array([knot.joints[name] for knot in motion.knots]) for name in ("a1", "a2")]
    low, high = 0.05, 5.0
    while high - low > 1e-7:
        middle = (low + high) / 2
        shares = drive.driven(course, q, middle).shares
        low, high = (low, middle) if shares.max() <= 1 else (middle, high)
    assert drive.least_duration(course, q, 2.0) == pytest.approx(high, rel=1e-5)
    assert drive.least_duration(course, q, 3.0) == pytest.approx(high, rel=1e-5)


def test_a_straightened_motion_is_closed_has_small_second_differences_and_keeps_its_ends() -> None:
    problem = copose.parse(path_problems.hinged())
    model = PostureModel(Cell.of(problem))
    journey = asked(problem, problem.path, model.cell.arms)
    course, rng = Course.of(model, journey, uniform(25)), np.random.default_rng(0)
    motion = copose.plan(problem)
    parts = [np.array([knot.joints[name] for knot in motion.knots]) for name in ("a1", "a2")]
    smooth = np.hstack(parts)
    rough = smooth + rng.uniform(-0.02, 0.02, smooth.shape)
    rough = np.hstack(closed_at(model, journey, model.split(rough), course.phases))
    fixed = np.zeros(rough.shape, dtype=bool)
    fixed[0] = True
    q = straightened(model, course, rough, fixed)
    for i, joints in enumerate(model.split(q)):
        assert np.abs(model.arms[i].gap(joints, course.goals[i])[:, :2]).max() < 1e-9
    assert q[0] == pytest.approx(rough[0], abs=1e-12)
    bend, best = (np.square(np.diff(motion_, 2, axis=0)).sum() for motion_ in (q, rough))
    assert bend < 0.05 * best
