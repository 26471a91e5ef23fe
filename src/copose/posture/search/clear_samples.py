"""Postures of the arms that hold the object clear of bodies in the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from copose.constraints.clearance import Blocked, in_the_way
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample, neighbours


@dataclass(frozen=True)
class ClearingOptions:
    """Options of looking for clear postures."""

    few: float = 0.5  # share of clear postures of an arm up to which others are closed between them
    between: tuple[float, ...] = (0.5, 0.25, 0.75)  # parts of the way, one after the other
    combined: int = 1024  # combinations that are looked at for what is always too near


@dataclass(frozen=True, eq=False)
class ArmPostures:
    """Postures of every arm that hold the object.

    Attributes:
        postures: by arm, (count_i, n_i).
        neighbours: by arm, indices of the postures next to each, (count_i, k).
    """

    postures: list[Array]
    neighbours: list[Indices]

    @classmethod
    def of(cls, samples: Sequence[ArmSample]) -> ArmPostures:
        """Postures of samples, one of each arm."""
        return cls([arm.closed for arm in samples], [arm.neighbours for arm in samples])


@dataclass(frozen=True, eq=False)
class Cleared(ArmPostures):
    """Postures of every arm that keep clear of all but the other arms.

    Attributes:
        blocked: what comes too near where none of an arm's is clear, or the object is in the way.
    """

    blocked: tuple[Blocked, ...]


def clear_postures(
    model: PostureModel,
    setting: Setting,
    postures: Sequence[Array],
    options: ClearingOptions = ClearingOptions(),
) -> Cleared:
    """Postures of each arm, (count_i, n_i), that keep clear of itself and of what stands still."""
    bodies, cell = setting.bodies, setting.cell
    assert bodies is not None
    nowhere = setting.configurations([None] * len(postures))
    kept, near, blocked = [], [], []
    if not bodies.clear(nowhere, bodies.still)[0]:
        blocked.append(in_the_way(bodies, nowhere, bodies.still, every=True))
    for i, q in enumerate(postures):
        clear = alone_clear(setting, i, q)
        if clear.mean() <= options.few:
            between = _between(model, setting, i, q, len(q) - int(clear.sum()), options)
            q = np.vstack([q, between])
            clear = np.concatenate([clear, np.ones(len(between), dtype=bool)])
        if not clear.any():
            x = setting.configurations(_alone(setting, i, q))
            blocked.append(in_the_way(bodies, x, bodies.own(i), every=cell.spare(i) <= 0))
        number = np.cumsum(clear) - 1
        # A neighbour that is gone is none: a posture beside itself changes nothing.
        adjacent = neighbours(cell, model.arms[i], i, q)[clear]
        own = np.flatnonzero(clear)[:, None]
        kept.append(q[clear])
        near.append(number[np.where(clear[adjacent], adjacent, own)])
    return Cleared(kept, near, tuple(blocked))


def alone_clear(setting: Setting, i: int, q: Array) -> Mask:
    """Mask of postures of arm i, (count, n), that keep clear of all but the other arms."""
    bodies = setting.bodies
    assert bodies is not None
    return bodies.clear(setting.configurations(_alone(setting, i, q)), bodies.own(i))


def kept_apart(setting: Setting, postures: Sequence[Array]) -> Callable[[Indices], Mask]:
    """Predicate of combinations, (count, K), of the arms' postures: the arms are clear of each
    other.
    """
    bodies = setting.bodies
    assert bodies is not None
    alone = [setting.configurations(_alone(setting, i, q)) for i, q in enumerate(postures)]
    judge = bodies.judge(alone)

    def allowed(chosen: Indices) -> Mask:
        clear, hit = judge(chosen)
        left = np.flatnonzero(~(clear | hit))
        if len(left):
            q = [q_i[rows] for q_i, rows in zip(postures, chosen[left].T, strict=True)]
            clear[left] = bodies.clear(setting.configurations(q), bodies.shared)
        return clear

    return allowed


def in_each_others_way(
    setting: Setting,
    postures: Sequence[Array],
    seed: int,
    options: ClearingOptions = ClearingOptions(),
) -> tuple[Blocked, ...]:
    """The arms that are in each other's way in all combinations, or in all of a random choice.

    Empty where some are clear, and torque limits decide.
    """
    bodies, cell = setting.bodies, setting.cell
    assert bodies is not None
    counts = [len(q) for q in postures]
    every = all(cell.spare(i) <= 0 for i in range(len(counts))) and prod(counts) <= options.combined
    if every:
        chosen = [grid.ravel() for grid in np.indices(counts)]
    else:
        rng = np.random.default_rng([seed, len(postures), 1])
        chosen = [rng.integers(0, count, options.combined) for count in counts]
    x = setting.configurations([q[k] for q, k in zip(postures, chosen, strict=True)])
    if bodies.clear(x, bodies.shared).any():
        return ()
    return (in_the_way(bodies, x, bodies.shared, every=every),)


def _alone(setting: Setting, i: int, q: Array) -> list[Array | None]:
    """Postures of arm i, and none of the others."""
    return [q if j == i else None for j in range(len(setting.cell.arms))]


def _between(
    model: PostureModel,
    setting: Setting,
    i: int,
    q: Array,
    most: int,
    options: ClearingOptions,
) -> Array:
    """Closed, clear postures of arm i between those next to each other, (count, n).

    Little of a self-motion may be clear, and few samples lie there. They are about ``most``.
    """
    cell, kernels = setting.cell, model.arms[i]
    clear = [q[:0]]
    if kernels.n == kernels.m or len(q) < 2:
        return clear[0]
    near = neighbours(cell, kernels, i, q)
    pairs = np.column_stack([np.repeat(np.arange(len(q)), near.shape[1]), near.ravel()])
    a, b = np.unique(np.sort(pairs, axis=1), axis=0).T
    apart = cell.nearest_turn(i, q[b] - q[a])
    goal = setting.placement.goals[i]
    for part in options.between:
        ends, gaps = project(kernels, q[a] + part * apart, goal, cell.lower[i], cell.upper[i])
        ends = ends[gaps < CLOSED]
        clear.append(ends[alone_clear(setting, i, ends)])
        if sum(map(len, clear)) >= most:
            break
    every = np.vstack(clear)
    return np.asarray(every[:: max(1, -(-len(every) // most))])
