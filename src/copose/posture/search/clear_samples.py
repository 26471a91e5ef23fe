"""What bodies in the way leave of the arms' postures that hold the object."""

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
from copose.self_motion.sampling import neighbours

# Combinations of which some are told.
_COMBINED = 1024
# Where at most such a part of an arm's postures is clear others are closed between those next to
# each other.
_FEW_CLEAR = 0.5
# At what parts of the way between them, one after the other.
_BETWEEN = (0.5, 0.25, 0.75)


@dataclass(frozen=True, eq=False)
class Cleared:
    """What is left of the arms' postures.

    Attributes:
        postures: by arm, (count_i, n_i).
        neighbours: by arm, indices of the postures next to each, (count_i, k).
        blocked: what comes too near where none of an arm's is clear, or the object is in the way.
    """

    postures: list[Array]
    neighbours: list[Indices]
    blocked: tuple[Blocked, ...]


def clear_postures(model: PostureModel, setting: Setting, postures: Sequence[Array]) -> Cleared:
    """Postures of each arm, (count_i, n_i), that keep clear of itself and of what stands still."""
    bodies, cell = setting.bodies, setting.cell
    assert bodies is not None
    here = setting.configurations([None] * len(postures))
    found, near, blocked = [], [], []
    if not bodies.clear(here, bodies.still)[0]:
        blocked.append(in_the_way(bodies, here, bodies.still, every=True))
    for i, mine in enumerate(postures):
        clear = alone_clear(setting, i, mine)
        if clear.mean() <= _FEW_CLEAR:
            more = _denser(model, setting, i, mine, len(mine) - int(clear.sum()))
            mine = np.vstack([mine, more])
            clear = np.concatenate([clear, np.ones(len(more), dtype=bool)])
        if not clear.any():
            x = setting.configurations(_alone(setting, i, mine))
            blocked.append(in_the_way(bodies, x, bodies.own(i), every=cell.spare(i) <= 0))
        number = np.cumsum(clear) - 1
        # A neighbour that is gone is none: a posture beside itself changes nothing.
        others = neighbours(cell, model.arms[i], i, mine)[clear]
        own = np.flatnonzero(clear)[:, None]
        found.append(mine[clear])
        near.append(number[np.where(clear[others], others, own)])
    return Cleared(found, near, tuple(blocked))


def alone_clear(setting: Setting, i: int, q: Array) -> Mask:
    """Which postures of arm i, (count, n), keep clear of all but the other arms."""
    bodies = setting.bodies
    assert bodies is not None
    return bodies.clear(setting.configurations(_alone(setting, i, q)), bodies.own(i))


def kept_apart(setting: Setting, postures: Sequence[Array]) -> Callable[[Indices], Mask]:
    """A test of combinations, (count, K), of the arms' postures: whether the arms are clear of each
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
            q = [mine[rows] for mine, rows in zip(postures, chosen[left].T, strict=True)]
            clear[left] = bodies.clear(setting.configurations(q), bodies.shared)
        return clear

    return allowed


def in_each_others_way(
    setting: Setting, postures: Sequence[Array], seed: int
) -> tuple[Blocked, ...]:
    """Which arms are in each other's way in all combinations, as far as some of them tell; in every
    one where they are few. None where some are clear, and torque limits decide.
    """
    bodies, cell = setting.bodies, setting.cell
    assert bodies is not None
    counts = [len(mine) for mine in postures]
    every = all(cell.spare(i) <= 0 for i in range(len(counts))) and prod(counts) <= _COMBINED
    if every:
        chosen = [grid.ravel() for grid in np.indices(counts)]
    else:
        rng = np.random.default_rng([seed, len(postures), 1])
        chosen = [rng.integers(0, count, _COMBINED) for count in counts]
    x = setting.configurations([mine[k] for mine, k in zip(postures, chosen, strict=True)])
    if bodies.clear(x, bodies.shared).any():
        return ()
    return (in_the_way(bodies, x, bodies.shared, every=every),)


def _alone(setting: Setting, i: int, q: Array) -> list[Array | None]:
    """Postures of arm i, and none of the others."""
    return [q if j == i else None for j in range(len(setting.cell.arms))]


def _denser(model: PostureModel, setting: Setting, i: int, q: Array, most: int) -> Array:
    """Closed postures of arm i between those next to each other, (count, n), that keep clear; about
    so many at most.

    Little of a self-motion may be clear, and few samples lie there.
    """
    cell, kernels = setting.cell, model.arms[i]
    found = [q[:0]]
    if kernels.n == kernels.m or len(q) < 2:
        return found[0]
    near = neighbours(cell, kernels, i, q)
    pairs = np.column_stack([np.repeat(np.arange(len(q)), near.shape[1]), near.ravel()])
    a, b = np.unique(np.sort(pairs, axis=1), axis=0).T
    apart = cell.nearest_turn(i, q[b] - q[a])
    goal = setting.placement.goals[i]
    for part in _BETWEEN:
        ends, gaps = project(kernels, q[a] + part * apart, goal, cell.lower[i], cell.upper[i])
        ends = ends[gaps < CLOSED]
        found.append(ends[alone_clear(setting, i, ends)])
        if sum(map(len, found)) >= most:
            break
    more = np.vstack(found)
    return np.asarray(more[:: max(1, -(-len(more) // most))])
