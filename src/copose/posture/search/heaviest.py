"""The heaviest object that a cell can hold, and the joint that gives way under a heavier one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.constraints.registry import constraints_of
from copose.objectives.payload import Payload
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.search.effort import EFFORTS
from copose.posture.search.global_search import search
from copose.posture.search.screening import combined
from copose.posture.setting import Setting
from copose.progress import hushed


@dataclass(frozen=True, eq=False)
class Heaviest:
    """The postures of a cell that hold the most.

    Attributes:
        q: stacked joints, (count, N), that of the largest mass first.
        mass: kg that the first holds, None where no posture holds anything.
        reason: a sentence on a cell in which no posture holds the object at rest: a joint's share
            of its limit is the largest in the first posture with the object as it is.
        sure: whether nothing holds more: contacts that cannot carry the object whatever the
            torques, or all postures were judged.
    """

    q: Array
    mass: float | None
    reason: str
    sure: bool


def all_judged(cell: Cell) -> bool:
    """True where a search compares all postures.

    It does of one or two arms, each of which has finitely many or curves that are followed whole.
    """
    return len(cell.arms) <= 2 and all(cell.spare(i) <= 1 for i in range(len(cell.arms)))


def all_combinations(postures: Sequence[Array], most: int = 4096) -> Array:
    """All combinations of postures by arm, (count_i, n_i), stacked, (count, N).

    There are none where they are more than can be judged one by one.
    """
    counts = [len(q) for q in postures]
    if math.prod(counts) > most:
        return np.zeros((0, sum(q.shape[1] for q in postures)))
    return combined(postures, np.indices(counts).reshape(len(counts), -1).T)


def uncarried(setting: Setting) -> bool:
    """True where no contact wrenches, however large, hold the object at rest."""
    assert setting.holding is not None
    P, weight = np.hstack(setting.holding.balance), setting.holding.weight
    missed = P @ np.linalg.lstsq(P, weight, rcond=None)[0] - weight
    return bool(np.abs(missed).max() > 1e-9 * (1 + np.abs(weight).max()))


def heaviest_object(cell: Cell, seed: int) -> Heaviest:
    """The postures that hold the most, by a search for the largest payload."""
    limits = cell.counted_limits
    constraints = [each for each in constraints_of(cell) if not each.torque_limited]
    rest = np.zeros(cell.problem.space.m)
    model = PostureModel(cell, Payload(limits, rest, cell.problem.space), constraints)
    setting = model.setting(cell)
    with hushed():
        outcome = search(model, setting, seed, EFFORTS["normal"])
    nothing = "no posture holds the object at rest within the torque limits"
    q = np.array([optimum.q for optimum in outcome.optima])
    if len(q) == 0 or setting.holding is None or model.capacity is None:
        reason = f"{nothing} and those of contact wrenches, however light it is"
        bound = setting.holding is not None and uncarried(setting)
        return Heaviest(q, None, reason, bound or all_judged(cell))
    best = outcome.optima[0]
    parts = [q_i[None] for q_i in cell.system.split(best.q)]
    hold = model.capacity.dynamics(setting.holding, parts).hold(setting.holding.hold)
    if hold is None:
        reason = f"{nothing} and those of contact wrenches"
        return Heaviest(q, best.objective, reason, all_judged(cell))
    shares = np.concatenate([np.abs(t) / T for t, T in zip(hold.torques, limits, strict=True)])
    names = [f"{arm.name}/{joint.name}" for arm in cell.arms for joint in arm.joints]
    # Several give way at once; rounding must not choose between them.
    worst = int(np.argmax(shares >= shares.max() - 1e-6))
    possible = f"a mass of {best.objective:.4g} kg would be possible"
    if best.objective <= 0:
        possible = "the arms cannot even hold themselves"
    reason = (
        f"{nothing}: joint {names[worst]} gives way, at best with {times(shares[worst])} times its "
        f"limit; {possible}"
    )
    return Heaviest(q, best.objective, reason, all_judged(cell))


def times(share: float) -> str:
    """A share of a limit in words, three digits after the point: never 1 for what is more."""
    text = f"{share:.3f}"
    return text if share <= 1 or float(text) > 1 else f"{share:.7f}"
