"""Proofs where self-motions pinch, slices touch them, and postures meet: right, or refused."""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin
import pytest

import copose
from cells import planar, random_cell
from copose.cell.cell import Cell
from copose.posture.model import PostureModel
from copose.problem import parse
from copose.proof.proof import Proof
from copose.robots import load_arms
from copose.self_motion.slices.sliced_arm import SliceOptions
from reference import UrdfArm

REFUSED = "nothing is proved: arm 'a1' passes a singular posture"


def line(distance: float) -> dict:
    """Two arms of three links of 0.4 m; the goal of the first is so far from its base."""
    cell = planar()
    cell["object"]["position"] = [distance - 0.55, 0.0]
    return cell


def best_of_grid(asked: copose.Problem, count: int = 160) -> float:
    """The best of many pairs of postures by the law of cosines, each link's direction on a grid."""
    model = PostureModel(Cell.of(asked))
    setting = model.setting(model.cell)
    theta, bend = np.meshgrid(2 * np.pi * np.arange(count) / count, [-1, 1], indexing="ij")
    terms = []
    for arm, goal, tie in zip(
        model.arms, setting.placement.goals, setting.placement.ties, strict=True
    ):
        rest = goal[0] + 1j * goal[1] - 0.4 * np.exp(1j * theta)
        reached = np.abs(rest) <= 0.8
        half = bend * np.arccos(np.minimum(np.abs(rest) / 0.8, 1.0))
        second, third = np.angle(rest) + half, np.angle(rest) - half
        turns = np.stack([theta, second, third], axis=-1)[reached]
        turns = np.vstack([np.roll(turns, k, axis=1) for k in range(3)])
        terms.append(arm.terms(np.diff(turns, prepend=0.0), tie))
    sums = (terms[0][:, None] + terms[1]).reshape(-1, terms[0].shape[1])
    return float(np.nanmax(setting.objective.values_of_sums(setting, sums)))


@pytest.mark.parametrize("more", [1e-6, 0.0, -1e-6])
def test_a_self_motion_that_pinches(more: float) -> None:
    """With a goal as far as a link is long all links may lie on one line: F. Grashof's rule says
    that nearer there are two self-motions, and farther one.
    """
    asked = parse(line(0.4 + more))
    solution = copose.solve(asked, prove=1e-3)
    proof = solution.search.proof
    if not more:
        assert proof.statement == REFUSED and proof.bound is None
        return
    assert proof.self_motions == {"a1": 1 if more > 0 else 2, "a2": 1}
    found = solution.objective.after
    assert proof.gap <= 1e-3 and proof.bound >= best_of_grid(asked) > found - 0.03
    model = PostureModel(Cell.of(asked))
    setting, low = model.setting(model.cell), Proof(found - 1e-3, 5e-4)
    low.run(model.cell, model.arms, setting.placement, setting.objective, lambda q: None)
    assert not low.done and low.search.highest >= found


@pytest.mark.parametrize("more", [1e-9, 0.0])
def test_a_slice_that_touches_a_self_motion(more: float) -> None:
    """The first joint turns back at a slice, where two postures are one."""
    slices = SliceOptions.slices
    turn = 2 * np.pi * (36 + 0.381966) / slices - np.pi + more
    c = np.cos(turn)
    asked = parse(line(0.4 * c + np.sqrt(0.16 * c**2 + 0.48)))
    proof = copose.solve(asked, prove=1e-3).search.proof
    assert proof.self_motions == {"a1": 1, "a2": 1}
    assert proof.gap <= 1e-3 and proof.bound >= best_of_grid(asked)
    odd = "1 counts odd: some may be missing" if proof.odd else "no count odd"
    assert proof.odd == (more == 0.0) and odd in proof.statement


@pytest.mark.parametrize("bend", [1e-1, 1e-4, 0.0])
def test_an_elbow_that_is_nearly_stretched(bend: float) -> None:
    """Two postures of the arm are so near one another, or one, where it is singular."""
    cell = random_cell(("ur5", "ur5"), "spatial", 4)
    thing, table = cell["object"], cell["arms"][0]
    names = list(load_arms(parse(cell))[0].joint_names)
    tip = UrdfArm(table, names).at(np.array([0.3, -1.0, bend, 0.7, 1.1, 0.4]))[0]
    placed = pin.SE3(pin.rpy.rpyToMatrix(*thing["rpy"]), np.array(thing["position"]))
    grasp = placed.inverse() * tip
    near = copy.deepcopy(cell)
    near["arms"][0]["grasp"] = {"position": grasp.translation.tolist(),
                                "rpy": pin.rpy.matrixToRpy(grasp.rotation).tolist()}  # fmt: skip
    solution = copose.solve(parse(near), prove=1e-6)
    proof = solution.search.proof
    if bend > 1e-2:
        again = copose.solve(parse(near), seed=3).objective.after
        assert proof.gap <= 1e-6 and proof.bound >= again and proof.odd == 0
    else:
        assert proof.bound is None and proof.statement.startswith("nothing is proved: ")
