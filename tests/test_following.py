"""Following an object from a posture without a search, and planners that serve many problems."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import copose

PROBLEMS = Path(__file__).parent.parent / "problems"
CELL = PROBLEMS / "paper-fig2.toml"

offset = st.floats(-0.03, 0.03)


@pytest.fixture(scope="module")
def planner() -> copose.Planner:
    return copose.Planner(copose.load(CELL), movable=True)


@pytest.fixture(scope="module")
def best(planner: copose.Planner) -> copose.Solution:
    return planner.solve()


@settings(max_examples=15, deadline=None)
@given(x=offset, y=offset, base=offset, mass=st.floats(0.5, 3.0))
def test_one_planner_solves_whatever_differs_in_parameters(
    planner: copose.Planner, best: copose.Solution, x: float, y: float, base: float, mass: float
) -> None:
    at = copose.load(CELL).object.position
    changes = {
        "object.position": [at[0] + x, at[1] + y],
        "object.mass": mass,
        "arms.a2.base.position.y": base,
    }
    moved = copose.load(CELL, set=changes)
    assert planner.fits(moved)
    followed = planner.follow(best.after.joints, problem=moved)
    anew = copose.Planner(moved)
    alone = anew.solve(warm=best)
    assert followed.solution is not None
    assert followed.solution.objective.after == pytest.approx(alone.objective.after, abs=1e-8)
    assert copose.verify(moved, followed.solution) == ()
    searched = planner.solve(problem=moved)
    assert searched.objective.after == pytest.approx(anew.solve().objective.after, abs=1e-8)
    stated = planner.evaluate(searched.after.joints, problem=moved)
    assert stated.objective.after == pytest.approx(searched.objective.after, abs=1e-12)


def test_what_is_no_parameter_needs_another_planner(planner: copose.Planner) -> None:
    for changes in (
        {"objective.kind": "isotropy"},
        {"constraints.joint_margin": 0.1},
        {"world.gravity": [0, -9.81]},
        {"arms.a1.links.0.mass": 7.0},
    ):
        other = copose.load(CELL, set=changes)
        assert not planner.fits(other)
        with pytest.raises(copose.InputError, match="more than parameters"):
            planner.solve(problem=other)
    fixed = copose.Planner(copose.load(CELL))
    assert not fixed.fits(copose.load(CELL, set={"arms.a1.base.position.x": 0.01}))
    assert fixed.fits(copose.load(CELL, set={"name": "other", "object.mass": 2.0}))


def test_bases_stay_where_bodies_count() -> None:
    collision = {"constraints.collision": True}
    planner = copose.Planner(copose.load(CELL, set=collision), movable=True)
    assert planner.fits(copose.load(CELL, set={**collision, "arms.a1.grasp.position.x": -0.11}))
    assert not planner.fits(copose.load(CELL, set={**collision, "arms.a1.base.position.x": 0.01}))


def test_a_miss_is_the_arm_that_is_too_short(
    planner: copose.Planner, best: copose.Solution
) -> None:
    """Links in a row reach no farther than their lengths add up."""
    problem = copose.load(CELL, set={"object.position": [3.0, 0.0]})
    followed = planner.follow(best.after.joints, problem=problem)
    assert followed.solution is None
    for arm in problem.arms:
        reach = sum(link.length for link in arm.links)
        tip = np.array([3.0, 0.0]) + np.array(arm.grasp.position)
        missing = np.linalg.norm(tip - np.array(arm.base.position)) - reach
        assert followed.gaps[arm.name].distance == pytest.approx(missing, abs=1e-6)
        assert followed.gaps[arm.name].angle == 0.0


def test_a_hand_that_cannot_turn_so_far_misses_by_an_angle() -> None:
    file = PROBLEMS / "two-panda-box.toml"
    planner = copose.Planner(copose.load(file))
    joints = planner.solve().after.joints
    turned = copose.load(file, set={"object.rpy": [0.0, 1.5, 0.0]})
    followed = planner.follow(joints, problem=turned)
    assert followed.solution is None
    assert any(gap.angle > 0.01 for gap in followed.gaps.values())


def test_optima_state_where_they_are(planner: copose.Planner, best: copose.Solution) -> None:
    for optimum in best.search.local_optima:
        assert optimum.joints is not None
        found = planner.evaluate(optimum.joints)
        assert found.objective.after == pytest.approx(optimum.objective, abs=1e-9)


def test_shares_are_those_of_an_evaluation() -> None:
    file = PROBLEMS / "two-panda-box.toml"
    problem = copose.load(file)
    planner = copose.Planner(problem)
    joints = planner.solve().after.joints
    shares, told = planner.holding_shares(joints), copose.evaluate(problem, joints)
    for name, mine in told.after.static_torque.items():
        np.testing.assert_allclose(shares[name], mine, atol=1e-9)
    everything = planner.evaluate(joints, everything=True)
    assert everything.after.payload == pytest.approx(told.after.payload, rel=1e-9)


def test_a_movable_planner_stays_movable() -> None:
    planner = pickle.loads(pickle.dumps(copose.Planner(copose.load(CELL), movable=True)))
    assert planner.fits(copose.load(CELL, set={"arms.a1.base.position.x": 0.01}))
