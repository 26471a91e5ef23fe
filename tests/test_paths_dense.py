"""Planned motions are as good as a dense program over the self-motions has them."""

from __future__ import annotations

import copy
import itertools

import numpy as np
import pytest
from baselines_path import Tracker

import copose
import path_problems
from copose.motion import plan
from dense_program import DenseProgram

GRID = {1: 300, 2: 120}


def test_its_volume_is_that_of_planner() -> None:
    tables = path_problems.three_jointed(1)
    dense, planner = DenseProgram(tables, 20), copose.Planner(copose.parse(tables))
    nodes, values = dense.layers[4]
    place = {"position": dense.path.at(dense.time[4]).position[:2].tolist()}
    rows = min(len(q) for q in nodes)
    found = planner.measure({f"a{i + 1}": q[:rows] for i, q in enumerate(nodes)}, object_pose=place)
    assert found.objective == pytest.approx(values[range(rows), range(rows)], rel=1e-9)


def test_its_nodes_hold_the_object() -> None:
    tables = path_problems.three_jointed(3)
    dense = DenseProgram(tables, 30)
    for i, arm in enumerate(tables["arms"]):
        angles = np.cumsum(dense.layers[7][0][i], axis=1)
        lengths = np.array([link["length"] for link in arm["links"]])
        tip = arm["base"]["position"] + np.column_stack(
            [np.cos(angles) @ lengths, np.sin(angles) @ lengths]
        )
        assert tip == pytest.approx(np.tile(dense.goal(i, dense.time[7]), (len(tip), 1)))


def test_it_finds_the_best_of_all_combinations() -> None:
    tables = path_problems.three_jointed(1)
    tables["path"] |= {"knots": 3, "duration": 1.0}
    dense = DenseProgram(tables, 3)
    pairs = [list(itertools.product(*nodes)) for nodes, _ in dense.layers]
    best = -np.inf
    for motion in itertools.product(*pairs):
        rows = np.array([np.concatenate(pair) for pair in motion])
        steps = [
            dense.step(i, q[None], to[None])
            for before, after in itertools.pairwise(motion)
            for i, (q, to) in enumerate(zip(before, after, strict=True))
        ]
        if np.all(np.isfinite(steps)):
            best = max(best, dense.measured(np.unwrap(rows, axis=0)).value)
    found = dense.best()
    assert (found is None) == (best == -np.inf)
    assert found is None or found.value == pytest.approx(best, abs=1e-12)


@pytest.mark.few(5)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 7, 9, 10, 15, 17, 20, 28])
def test_a_planned_motion_is_the_best_of_a_dense_grid(seed: int) -> None:
    tables = path_problems.three_jointed(seed)
    motion = plan(copose.parse(tables))
    assert motion.status == "solved" and motion.smoothness is not None
    value = motion.objective.after - tables["path"]["smoothness"] * motion.smoothness
    tables["path"]["knots"] = len(motion.time)
    # The grid comes from below: the planner may be better than its grain, and never worse.
    dense = DenseProgram(tables, GRID[len(tables["arms"])]).best()
    assert dense is not None
    assert value >= dense.value - 1e-6
    assert value <= dense.value + 0.01 * abs(dense.value)


def test_where_no_motion_is_on_the_grid_the_planner_says_so() -> None:
    tables = path_problems.three_jointed(5)
    motion = plan(copose.parse(tables))
    assert DenseProgram(tables, 120).best() is None
    assert motion.status == "infeasible" and motion.knots is None
    assert "a2" in motion.reason and "s: " in motion.reason


def test_the_planner_gets_through_where_greed_meets_a_limit() -> None:
    tables = path_problems.trapped()
    motion = plan(copose.parse(tables))
    assert motion.status == "solved"
    assert motion.objective.before is None
    first = np.concatenate(list(motion.knots[0].joints.values()))
    tracker = Tracker(tables)
    for gain in (0.0, 0.1, 1.0, 10.0):
        reason = tracker.follow(first, gain).reason
        assert reason is not None and "arm 0" in reason and "limits" in reason
    tables["arms"][0]["start"], tables["arms"][1]["start"] = first[:3], first[3:]
    dense = DenseProgram(tables, 120).best()
    assert dense is not None
    value = motion.objective.after - tables["path"].get("smoothness", 0.01) * motion.smoothness
    assert value >= dense.value - 0.01 * abs(dense.value)


def test_the_best_posture_is_told_to_be_out_of_reach() -> None:
    tables = path_problems.cut_off()
    best = copose.solve(copose.parse(tables))
    assert best.reachable_from_start is False
    dense = DenseProgram(path_problems.along(tables, {}, {}, knots=2), 200)
    start = np.array(tables["arms"][0]["start"])
    near = dense.reached(start, 0, 0.0)
    assert len(near) > 20
    apart = np.abs(near - best.after.joints["a1"]).max(axis=1)
    assert apart.min() > 0.3
    kept = copy.deepcopy(tables) | {"search": {"reachable": True}}
    solution = copose.solve(copose.parse(kept))
    assert solution.reachable_from_start is True
    assert np.abs(near - solution.after.joints["a1"]).max(axis=1).min() < 0.1
    other = dense.reached(np.array(solution.before.joints["a2"]), 1, 0.0)
    values = dense.values([dense.own(0, near), dense.own(1, other)])
    assert solution.objective.after >= values.max() - 1e-9
    assert solution.objective.after <= values.max() + 0.01
