"""What bodies in the way leave of the arms' postures that hold the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from copose.planning.cell import Cell
from copose.planning.clearance import Blocked, Clearance, Near
from copose.planning.closing import CLOSED, project
from copose.planning.machinery import Machinery, Setting
from copose.planning.self_motion import neighbours
from copose.poses import Array, Indices, Mask

# Postures whose bodies are measured where capsules leave none of an arm's, ends of climbs that are;
# and combinations of which some are told.
_MEASURED, _MEASURED_ENDS, _COMBINED = 64, 16, 1024
# Where at most such a part of an arm's postures is clear others are closed between those next to
# each other, at such parts of the way.
_FEW_CLEAR, _BETWEEN = 0.5, (0.25, 0.5, 0.75)


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


def clear_postures(machinery: Machinery, setting: Setting, postures: Sequence[Array]) -> Cleared:
    """Postures of each arm, (count_i, n_i), that keep clear of itself and of what stands still."""
    clearance, cell = setting.clearance, setting.cell
    assert clearance is not None
    nothing: list[Array | None] = [None] * len(postures)
    clearance.loosen(cell, nothing, clearance.still)
    hit = clearance.near(cell, nothing, clearance.still, 0.0)
    found, near, blocked = [], [], []
    if len(hit.rows) and not clearance.exactly(cell, nothing, clearance.still):
        blocked.append(clearance.in_the_way(cell, nothing, hit, 1, every=True))
    for i, mine in enumerate(postures):
        clearance.loosen(cell, _alone(cell, i, mine), clearance.own(i))
        clear, hit = _clear(clearance, cell, i, mine)
        if clear.mean() <= _FEW_CLEAR:
            mine = np.vstack([mine, _denser(machinery, setting, i, mine)])
            clear, hit = _clear(clearance, cell, i, mine)
        if not clear.any():
            # Capsules would have it that nothing is clear: bodies decide.
            clear[_exactly_clear(clearance, cell, i, mine, hit, _MEASURED)] = True
        if not clear.any():
            alone = _alone(cell, i, mine)
            every = cell.spare(i) <= 0
            blocked.append(clearance.in_the_way(cell, alone, hit, _MEASURED, every=every))
        number = np.cumsum(clear) - 1
        # A neighbour that is gone is none: a posture beside itself changes nothing.
        others = neighbours(cell, machinery.arms[i], i, mine)[clear]
        own = np.flatnonzero(clear)[:, None]
        found.append(mine[clear])
        near.append(number[np.where(clear[others], others, own)])
    return Cleared(found, near, tuple(blocked))


def clear_alone(setting: Setting, i: int, q: Array) -> Array:
    """Those postures of arm i, (count, n), that keep clear of all but the other arms.

    Of some of those whose capsules do not, bodies decide: a climb may have ended where they touch.
    """
    return np.asarray(q[alone_clear(setting, i, q, _MEASURED_ENDS)])


def alone_clear(setting: Setting, i: int, q: Array, most: int) -> Mask:
    """Which postures of arm i, (count, n), keep clear of all but the other arms; bodies decide for
    so many whose capsules do not.
    """
    clearance, cell = setting.clearance, setting.cell
    assert clearance is not None
    clear, hit = _clear(clearance, cell, i, q)
    clear[_exactly_clear(clearance, cell, i, q, hit, most)] = True
    return clear


def in_each_others_way(setting: Setting, postures: Sequence[Array], seed: int) -> Blocked:
    """Which arms are in each other's way in all combinations, as far as some of them tell; in every
    one where they are few.
    """
    clearance, cell = setting.clearance, setting.cell
    assert clearance is not None
    counts = [len(mine) for mine in postures]
    every = all(cell.spare(i) <= 0 for i in range(len(counts))) and prod(counts) <= _COMBINED
    if every:
        chosen = [grid.ravel() for grid in np.indices(counts)]
    else:
        rng = np.random.default_rng([seed, len(postures), 1])
        chosen = [rng.integers(0, count, _COMBINED) for count in counts]
    q = [mine[rows] for mine, rows in zip(postures, chosen, strict=True)]
    hit = clearance.near(cell, q, clearance.every, 0.0)
    if not len(hit.rows):
        return Blocked("none of the combinations that torque limits allow does", sure=False)
    return clearance.in_the_way(cell, q, hit, _COMBINED if every else _MEASURED, every=every)


def _alone(cell: Cell, i: int, q: Array) -> list[Array | None]:
    """Postures of arm i, and none of the others."""
    return [q if j == i else None for j in range(len(cell.arms))]


def _clear(clearance: Clearance, cell: Cell, i: int, q: Array) -> tuple[Mask, Near]:
    """Which postures of arm i, (count, n), have capsules that keep clear, and what does not."""
    hit = clearance.near(cell, _alone(cell, i, q), clearance.own(i), 0.0)
    clear = np.ones(len(q), dtype=bool)
    clear[hit.rows] = False
    return clear, hit


def _denser(machinery: Machinery, setting: Setting, i: int, q: Array) -> Array:
    """Closed postures of arm i between those next to each other, (count, n), that keep clear; no
    more of them than of these.

    Little of a self-motion may be clear, and few samples lie there.
    """
    cell, kernels = setting.cell, machinery.arms[i]
    if kernels.n == kernels.m or len(q) < 2:
        return q[:0]
    near = neighbours(cell, kernels, i, q)
    pairs = np.column_stack([np.repeat(np.arange(len(q)), near.shape[1]), near.ravel()])
    a, b = np.unique(np.sort(pairs, axis=1), axis=0).T
    apart = cell.nearest_turn(i, q[b] - q[a])
    drawn = np.vstack([q[a] + part * apart for part in _BETWEEN])
    goal = setting.placement.goals[i]
    ends, gaps = project(kernels, drawn, goal, cell.lower[i], cell.upper[i])
    found = ends[gaps < CLOSED]
    assert setting.clearance is not None
    found = found[_clear(setting.clearance, cell, i, found)[0]]
    return np.asarray(found[:: max(1, -(-len(found) // len(q)))])


def _exactly_clear(
    clearance: Clearance, cell: Cell, i: int, q: Array, hit: Near, most: int
) -> list[int]:
    """Postures of arm i, (count, n), whose bodies keep clear though their capsules do not; of those
    whose capsules are the least too near.
    """
    least = np.full(len(q), np.inf)
    np.minimum.at(least, hit.rows, hit.spare)
    found = []
    rows = np.flatnonzero(np.isfinite(least))
    for k in rows[np.argsort(-least[rows], kind="stable")[:most]]:
        if clearance.exactly(cell, _alone(cell, i, q[k][None]), clearance.own(i)):
            found.append(int(k))
    return found
