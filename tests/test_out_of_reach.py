"""Out of reach: bounds no posture breaks, nearest misses, and the rotation that would close."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import out_of_reach
import pinocchio as pin
import pytest
from building import ROBOTS
from scipy.optimize import least_squares

import copose
from cells import planar, tables
from copose.cell.cell import Cell
from copose.posture.model import PostureModel
from copose.robots import finite_range, load_arms
from copose.robots.reach_bounds import ReachBound
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.least_squares import nearest
from reference import UrdfArm


def one_arm(robot: str) -> tuple[object, UrdfArm]:
    """An arm at the origin, and Pinocchio's."""
    spec = ROBOTS[robot] | {"name": "arm", "grasp": {"position": [0.0, 0.0, 0.0]}}
    cell = {
        "format": 1, "name": robot, "task": {"space": "spatial"},
        "object": {"mass": 1.0, "inertia": [1.0] * 3, "position": [0.0, 0.0, 0.0]}, "arms": [spec],
    }  # fmt: skip
    arm = load_arms(copose.parse(cell))[0]
    return arm, UrdfArm(spec, list(arm.joint_names))


def goal_of(tip: pin.SE3) -> np.ndarray:
    x, y, z, w = pin.Quaternion(tip.rotation).coeffs()
    return np.array([*tip.translation, w, x, y, z])


@pytest.mark.parametrize("robot", ["panda", "ur5", "kinova", "tiago-left"])
def test_no_posture_breaks_a_bound(robot: str) -> None:
    arm, truth = one_arm(robot)
    if robot.startswith("tiago"):
        spec = ROBOTS[robot]
        spec = {key: value for key, value in spec.items() if key != "locked"}
        ROBOTS["lifted"] = spec
        try:
            arm, truth = one_arm("lifted")
        finally:
            del ROBOTS["lifted"]
        assert arm.joints[0].kind == "prismatic"
    rng = np.random.default_rng(0)
    low, high = finite_range(arm.lower, arm.upper)
    for k in range(4):
        lower, upper = low, high
        if k:
            lower = low + rng.uniform(0, 0.5, arm.n) * (high - low)
            upper = lower + rng.uniform(0, 1, arm.n) * (high - lower)
        bound = ReachBound(arm.joints, arm.tip, lower, upper)
        for q in rng.uniform(lower, upper, (60, arm.n)):
            goal = goal_of(truth.origin.inverse() * truth.at(q)[0])
            for rigid in (True, False):
                assert bound.missed(goal, rigid=rigid) <= 1e-9


@pytest.mark.parametrize(("height", "miss"), [(1.35, 0.2206), (1.15, 0.0235), (1.125, -0.001)])
def test_the_bound_of_a_panda_is_what_its_shoulder_and_wrist_leave(
    height: float, miss: float
) -> None:
    """By hand: links of 0.3266 and 0.3928 m, and the wrist's circle of 0.088 m about joint 7."""
    cell = tables("two-panda-box")
    cell["object"]["position"][2] = height
    ready = Cell.of(copose.parse(cell))
    goal = PostureModel(ready).setting(ready).placement.goals[0]
    shoulder, elbow = np.array([0, 0, 0.333]), np.hypot([0.316, 0.384], 0.0825).sum()
    x, y, z = pin.Quaternion(goal[4], goal[5], goal[6], goal[3]).toRotationMatrix().T
    away = shoulder - (goal[:3] - 0.107 * z)
    aside = np.hypot(away @ x, away @ y) - 0.088
    exact = np.hypot(away @ z, aside) - elbow
    assert exact == pytest.approx(miss, abs=1e-3)
    found = ReachBound.of(ready.arms[0], ready.lower[0], ready.upper[0]).missed(goal, rigid=True)
    assert found == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize(("links", "space"), [(3, "planar-linear"), (4, "planar")])
def test_nearest_misses_are_those_of_scipy(links: int, space: str) -> None:
    cell = planar(1, links, space)
    cell["object"]["position"] = [1.6, 0.9]
    cell["arms"][0]["position_limits"] = [[-1.0, 1.2]] * links
    ready = Cell.of(copose.parse(cell))
    kernels: ArmKernels = PostureModel(ready).arms[0]
    goal = PostureModel(ready).setting(ready).placement.goals[0]
    lower, upper = ready.lower[0], ready.upper[0]
    drawn = np.random.default_rng(1).uniform(0.9 * lower, 0.9 * upper, (12, links))
    weights = np.arange(1.0, 1.0 + kernels.m)
    ends, gaps = nearest(kernels, drawn, goal, lower, upper, weights=weights)
    assert np.all((ends >= lower) & (ends <= upper))
    found = [
        least_squares(
            lambda q: weights * kernels.residual(q[None], goal)[0][0], q, bounds=(lower, upper),
            xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )
        for q in drawn
    ]  # fmt: skip
    misses = np.sqrt([2 * end.cost for end in found])
    assert gaps.min() == pytest.approx(misses.min(), rel=1e-6)
    # From a few starts they may end in another of the minima.
    assert np.median(gaps) <= np.median(misses) * (1 + 1e-6)


def pasted(cell: dict, reason: str) -> int:
    """How many grasps a reason turns; they are turned."""
    told = re.findall(r"arm '(\w+)'[^;]*(?:;[^;]*?)*?(grasp\.\w+ = [^;]+)", reason)
    for name, line in told:
        arm = next(arm for arm in cell["arms"] if arm["name"] == name)
        arm["grasp"] |= tomllib.loads(line)["grasp"]
    return len(told)


def test_a_panda_s_grasp_as_it_is_told_closes() -> None:
    cell = tables("two-panda-box")
    cell["object"]["position"][2] = 1.15
    missed = copose.solve(copose.parse(cell), effort="low")
    assert missed.status == "infeasible" and "m and" in missed.reason and "°" in missed.reason
    assert pasted(cell, missed.reason) == 2
    assert copose.solve(copose.parse(cell), effort="low").status == "solved"


@pytest.mark.parametrize("seed", range(4))
def test_a_planar_grasp_as_it_is_told_closes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = planar(1, 3, "planar")
    cell["arms"][0]["position_limits"] = [[-3, 3], [-3, 3], [-0.1, 0.1]]
    cell["arms"][0]["grasp"]["angle"] += np.pi + rng.uniform(-0.3, 0.3)
    missed = copose.solve(copose.parse(cell), effort="low")
    assert missed.status in ("infeasible", "failed")
    assert pasted(cell, missed.reason) == 1
    assert copose.solve(copose.parse(cell), effort="low").status == "solved"


@pytest.mark.parametrize("wrong", [0.0, 0.02])
def test_nothing_at_the_rim_that_closes_is_called_infeasible(
    wrong: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless the bound were too large: that would be seen."""
    missed = ReachBound.missed
    monkeypatch.setattr(
        ReachBound, "missed", lambda self, goal, *, rigid: missed(self, goal, rigid=rigid) + wrong
    )
    monkeypatch.setattr(out_of_reach, "PROJECTIONS", 40)
    seen = out_of_reach.judged("planar-pair", 8, compiled=False)
    assert seen.total() == 8
    assert (seen["infeasible", True] > 0) == (wrong > 0)
    assert wrong or (seen["failed", True] == 0 and seen["solved", True] > 1)


def test_of_many_arms_those_that_surely_miss_are_told_first() -> None:
    cell = planar(4, 3)
    cell["arms"][1]["base"]["position"] = [3.0, 0.1]
    missed = copose.solve(copose.parse(cell), effort="low")
    assert missed.status == "infeasible" and missed.reason.startswith("arm 'a2'")
