"""Coordination of arms along their self-motions so that bodies keep the clearance.

With bodies in the way the arms are not independent: what one keeps clear of depends on where the
others are. Each arm has nodes along its self-motion; one arm at a time moves by a node, through
combinations that keep the clearance (the coordination diagram).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.search.clear_samples import alone_clear, kept_apart
from copose.posture.setting import Setting
from copose.self_motion.curves.curve import Curve


@dataclass(frozen=True, eq=False)
class CurveNodes:
    """Postures of one arm along its self-motion.

    Attributes:
        q: in order, (count, n).
        loop: whether the last is followed by the first.
        start: number of the start.
        end: number of the posture to be reached; None where it is not among them.
    """

    q: Array
    loop: bool
    start: int
    end: int | None

    @classmethod
    def along(
        cls, curve: Curve, start: Array, end: Array | None, spacing: float = 0.05
    ) -> CurveNodes:
        """Nodes along a curve through start and, if any, end, (n,); spacing in rad (or m)."""
        parts = [np.linspace(0.0, far, max(1, int(np.ceil(far / spacing))), endpoint=False)
                 for far in curve.lengths]  # fmt: skip
        rows = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        along = np.concatenate(parts)
        q, closed = curve.at(rows, along)
        keys = [*zip(rows[closed], along[closed], strict=True)]
        postures = list(q[closed])
        for mark in (start, end):
            place = None if mark is None else curve.place(mark)
            keys.append((np.inf, 0.0) if place is None or mark is None else place)
            postures.append(start if mark is None else mark)
        order = sorted(range(len(keys)), key=lambda k: keys[k])
        gone = sum(key[0] == np.inf for key in keys)
        where = {k: position for position, k in enumerate(order)}
        last = len(keys) - 1
        return cls(
            q=np.array([postures[k] for k in order[: len(order) - gone]]),
            loop=curve.loop,
            start=where[last - 1],
            end=where[last] if keys[last][0] < np.inf else None,
        )

    @classmethod
    def still(cls, q: Array) -> CurveNodes:
        """The one node of an arm that stays, at a posture, (n,)."""
        return cls(q[None], False, 0, 0)

    @classmethod
    def trail(cls, q: Sequence[Array]) -> CurveNodes:
        """Nodes of a walk from start to end, (n,) each."""
        points = np.array(q)
        return cls(points, False, 0, len(points) - 1)

    def ways(self) -> list[Array]:
        """Postures from start to end, one or, on a loop, both ways round, (count, n)."""
        assert self.end is not None
        step = 1 if self.end >= self.start else -1
        count, far = len(self.q), abs(self.end - self.start)
        ways = [[self.start + step * k for k in range(far + 1)]]
        if self.loop:
            ways.append([(self.start - step * k) % count for k in range(count - far + 1)])
        return [self.q[way] for way in ways]


def one_after_another(model: PostureModel, setting: Setting, arms: Sequence[CurveNodes]) -> bool:
    """True if arms that move from start to end one by one, in some order, keep clear."""
    moving = [i for i, nodes in enumerate(arms) if nodes.start != nodes.end]
    if not moving:
        return True
    # Of more arms there are too many orders.
    orders = permutations(moving) if len(moving) <= 4 else iter([tuple(moving)])
    for order in orders:
        for ways in product(*(arms[i].ways() for i in order)):
            present = [nodes.q[nodes.start] for nodes in arms]
            clear = True
            for i, way in zip(order, ways, strict=True):
                q = np.hstack([way if j == i else np.tile(x, (len(way), 1))
                               for j, x in enumerate(present)])  # fmt: skip
                present[i] = way[-1]
                clear = bool(model.feasibility.clear(setting, q).all())
                if not clear:
                    break
            if clear:
                return True
    return False


class CoordinationGrid:
    """The coordination diagram of at most two arms that move, as a grid over their nodes.

    Attributes:
        moving: numbers of the arms that move.
        reached: entries that can be reached from the start, (count_a, count_b); one column where
            one arm moves.
    """

    def __init__(self, setting: Setting, arms: Sequence[CurveNodes]) -> None:
        """Search the diagram from the arms' starts."""
        self._setting, self._arms = setting, arms
        self.moving = [i for i, nodes in enumerate(arms) if len(nodes.q) > 1][:2]
        assert all(len(nodes.q) == 1 for i, nodes in enumerate(arms) if i not in self.moving)
        self._loops = [arms[i].loop for i in self.moving]
        # Distances are computed of entries that are reached, or next to one that is.
        clear = self._alone()
        known = ~clear
        first = self.index([nodes.start for nodes in arms])
        self.reached, front = np.zeros(clear.shape, dtype=bool), np.zeros(clear.shape, dtype=bool)
        front[first] = True
        while (front & ~known).any():
            rows = np.argwhere(front & ~known)
            clear[tuple(rows.T)] = self._together(rows)
            known |= front
            self.reached |= front & clear
            front = self._widened() & clear

    def index(self, which: Sequence[int]) -> tuple[int, int]:
        """The entry of a combination of nodes, by arm."""
        chosen = [which[i] for i in self.moving]
        a, b = (*chosen, 0, 0)[:2]
        return a, b

    def allowed(self, chosen: Indices) -> Mask:
        """Mask of combinations of nodes of all arms, (count, K), that can be reached, (count,)."""
        columns = [chosen[:, i] for i in self.moving]
        nothing = np.zeros(len(chosen), dtype=np.intp)
        a, b = (*columns, nothing, nothing)[:2]
        return np.asarray(self.reached[a, b])

    def _alone(self) -> Mask:
        """Mask of entries whose nodes keep clear of all but the other arms."""
        clear = np.ones([len(self._arms[i].q) for i in self.moving] or [1], dtype=bool)
        clear = clear.reshape((*clear.shape, 1)[:2])
        for i, nodes in enumerate(self._arms):
            arm_clear = alone_clear(self._setting, i, nodes.q)
            clear &= arm_clear if i in self.moving[1:] else arm_clear[:, None]
        return clear

    def _together(self, rows: Indices) -> Mask:
        """Mask of entries, (count, 2), that keep the arms clear of each other, (count,)."""
        chosen = np.zeros((len(rows), len(self._arms)), dtype=np.intp)
        for column, i in enumerate(self.moving):
            chosen[:, i] = rows[:, column]
        return kept_apart(self._setting, [nodes.q for nodes in self._arms])(chosen)

    def _widened(self) -> Mask:
        """Mask of entries that are reached or next to one that is."""
        entries = self.reached
        for axis, loop in enumerate(self._loops):
            entries = entries | _dilated(self.reached, axis, loop)
        return entries


def _dilated(entries: Mask, axis: int, loop: bool) -> Mask:
    """A mask together with the next entries along an axis, round the end of a loop."""
    dilated = entries.copy()
    for way in (1, -1):
        shifted = np.roll(entries, way, axis=axis)
        if not loop:
            edge = np.moveaxis(shifted, axis, 0)
            edge[0 if way > 0 else -1] = False
        dilated |= shifted
    return dilated
