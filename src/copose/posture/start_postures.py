"""Starts of the arms of a problem, before anything is solved."""

from __future__ import annotations

import numpy as np

from copose.cell.cell import Cell
from copose.objectives.registry import objective_of
from copose.poses import Array
from copose.posture.search.effort import EFFORTS
from copose.robots import ArmStart
from copose.self_motion.kernels import ArmKernels, KernelInputsBuilder
from copose.self_motion.sampling import ArmSampler


def starts(cell: Cell) -> tuple[ArmStart, ...]:
    """Every arm at its start; where the problem gives none, in the first posture in which the seed
    closes it, else in the nearest miss of many.
    """
    states = []
    objective = objective_of(cell)
    goals = KernelInputsBuilder(cell.system, objective.sums, objective.scales)(
        cell.parameters
    ).goals
    kernels: tuple[ArmKernels, ...] = ()
    if any(arm.start is None for arm in cell.arms):
        kernels = cell.system.by_model(lambda arm: ArmKernels.of(arm, objective.sums))
    for i, arm in enumerate(cell.arms):
        q = _drawn(cell, kernels[i], i, goals[i]) if arm.start is None else arm.start
        states.append(
            ArmStart(
                arm=arm,
                joints=q,
                object=cell.problem.object.pose,
                rigid=cell.system.space.rigid,
                given=arm.start is not None,
            )
        )
    return tuple(states)


def _drawn(cell: Cell, kernels: ArmKernels, i: int, goal: Array) -> Array:
    """The posture that the seed gives arm i, (n,)."""
    effort, rng = EFFORTS["normal"], np.random.default_rng([cell.problem.search.seed, i])
    sampler = ArmSampler(cell, kernels, i, goal)
    sample = sampler.sample(rng, effort.batch, 1, effort.loops, effort.insistence)
    return np.asarray((sample.closed if len(sample.closed) else sample.missed)[0])
