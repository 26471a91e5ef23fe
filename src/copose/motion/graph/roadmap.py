"""An arm's self-motions along a course: postures layer by layer, and the moves between them.

With the object on its way an arm's self-motion changes from layer to layer. Its postures are
followed along, what opens up is filled from beside, and a posture has moves to the next layer's
postures beside the one that it is carried to and to no others: a branch is never jumped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.motion.path.knots import Course
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.search.global_search import EFFORTS
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler

# Between postures along a self-motion, rad (or m); closer ones are one posture.
SPACING, _ALIKE = 0.2, 0.02
# How far from where it is carried to a posture may move, in spacings, how far off the tangent, and
# how far it is carried from one layer to the next, rad or m.
_BESIDE, _ASLANT, _CARRIED = 1.7, 0.5, 1.0
# Postures of a layer, with one degree of freedom to spare and with more, of how many they are first
# chosen, and by how much spacings grow where there would be more.
_MOST, _MOST_SURFACE, _DRAWN, _COARSER = 120, 200, 480, 1.25
# By how much squares of distances may be rounded.
_ROUNDED = 1e-9
# How many times more of them there may be around a posture to start from.
_FROM_START = 2


@dataclass(frozen=True, eq=False)
class Layer:
    """Closed postures of an arm at an instant, and how to come to them from the layer before.

    Attributes:
        q: within limits, (count, n).
        carried: where each posture of the layer before ends when it is only closed again,
            (count before, n); NaN where it does not.
        moves: joint differences from each posture of the layer before, (count before, count, n);
            NaN where there is no move.
    """

    q: Array
    carried: Array
    moves: Array

    @cached_property
    def _some(self) -> tuple[Indices, Indices]:
        """Which moves there are: numbers of the postures before, and of those after."""
        rows, columns = np.nonzero(np.isfinite(self.moves[:, :, 0]))
        return rows, columns

    @cached_property
    def length(self) -> Array:
        """‖Δq‖² of the moves, infinite where there is none, (count before, count)."""
        return self._filled((self.moves[self._some] ** 2).sum(axis=1))

    def pace(self, velocity: Array) -> Array:
        """The time that each move takes at least, s, infinite where there is none."""
        return self._filled((np.abs(self.moves[self._some]) / velocity).max(axis=1))

    def _filled(self, values: Array) -> Array:
        found = np.full(self.moves.shape[:2], np.inf)
        found[self._some] = values
        return found


class Roadmap:
    """The layers of one arm, first to last.

    Attributes:
        layers: one for each instant of the course, as far as there are postures.
        spacing: between postures along a self-motion, rad or m.
        spare: degrees of freedom that it has to spare.
        simple: whether that is no more than one.
        held: of the first and the last layer, the number of the posture that it has to be; None
            where any serves.
    """

    def __init__(
        self,
        model: PostureModel,
        course: Course,
        i: int,
        seed: int,
        start: Array | None,
        goal: Array | None,
        *,
        returns: bool,
        finer: int = 1,
    ) -> None:
        """Follow arm i along a course.

        Args:
            model: what is built.
            course: the layers' instants.
            i: the arm.
            seed: of what is drawn.
            start: the posture that it starts in, (n,), closed.
            goal: the posture that it ends in, alike.
            returns: whether it ends in the posture that it began with.
            finer: how many times nearer to each other postures of a curve are than they need be.
        """
        self._cell, self._kernels, self._i = model.cell, model.arms[i], i
        self._course, arm = course, model.cell.arms[i]
        self._lower, self._upper = model.cell.lower[i], model.cell.upper[i]
        self.unlimited = np.array(
            [j.kind == "revolute" and not np.isfinite([j.lower, j.upper]).any() for j in arm.joints]
        )
        self.spare = spare = 0 if arm.fixed else self._kernels.n - self._kernels.m
        self.simple = spare <= 1
        self._most = _MOST if self.simple else _MOST_SURFACE
        finer = finer if self.simple else 1
        self.spacing, self._most = SPACING / finer, finer * self._most
        self.held: list[int | None] = [None, None]
        if start is not None and self.simple:
            # What is on no curve with it can never be come to.
            first, self.held[0] = self._grown(start[None], _FROM_START * self._most), 0
        else:
            first = self._sampled(seed)
            if start is not None:
                first, self.held[0] = self._with(first, start)
        nothing = np.zeros((0, self._kernels.n))
        self.layers = [Layer(first, nothing, np.zeros((0, len(first), self._kernels.n)))]
        for k in range(1, len(course)):
            if len(self.layers[-1].q) == 0:
                break
            last = k == len(course) - 1
            must = nothing
            if last and goal is not None:
                must = goal[None]
            elif last and returns:
                must = first if self.held[0] is None else first[[self.held[0]]]
            self.layers.append(self._next(k, must))
        if goal is not None:
            self.held[1] = self._number(self.layers[-1].q, goal)

    @property
    def count(self) -> int:
        """Postures of all layers."""
        return sum(len(layer.q) for layer in self.layers)

    def apart(self, many: Array, q: Array) -> Array:
        """Differences of postures to others, (..., n); a whole turn of a joint without limits is
        none.
        """
        difference = many - q
        if not self.unlimited.any():
            return np.asarray(difference)
        turned = np.pi - np.mod(np.pi - difference, 2 * np.pi)
        return np.where(self.unlimited, turned, difference)

    def _sampled(self, seed: int) -> Array:
        effort = EFFORTS["normal"]
        goal = self._course.goals[self._i][0]
        sampler = ArmSampler(self._cell, self._kernels, self._i, goal)
        rng = np.random.default_rng([seed, self._i])
        found = sampler.sample(rng, effort.batch, effort.batches, _DRAWN, effort.insistence)
        q = self._thinned(found.closed[:0], found.closed, 0.5 * self.spacing)
        while len(q) > self._most:
            # Long self-motions are sampled more coarsely, not in part.
            self.spacing *= _COARSER
            q = self._thinned(q[:0], q, 0.5 * self.spacing)
        # The sample may be coarser than what bodies leave.
        return q if self.spacing >= SPACING else self._grown(q, self._most)

    def _grown(self, q: Array, most: int) -> Array:
        """The first layer's postures that some spread to along their self-motions."""
        while len(q) and len(q) < most:
            more = self._beside(q, 0)
            if not len(more):
                break
            q = np.vstack([q, more])
        return q[:most]

    def _with(self, q: Array, posture: Array) -> tuple[Array, int]:
        """Postures with one that has to be among them, and its number."""
        apart = np.abs(self.apart(q, posture)).max(axis=1, initial=0.0) > _ALIKE
        return np.vstack([posture[None], q[apart]]), 0

    def _number(self, q: Array, posture: Array) -> int | None:
        apart = np.abs(self.apart(q, posture)).max(axis=1, initial=0.0)
        return int(apart.argmin()) if len(q) and apart.min() < 1e-6 else None

    def _project(self, q: Array, k: int) -> tuple[Array, Mask]:
        """Postures closed at layer k within limits, and which of them are."""
        goal = self._course.goals[self._i][k]
        ends, gaps = project(
            self._kernels, q, goal, self._lower, self._upper, steps=12, closed=0.1 * CLOSED
        )
        return ends, gaps <= CLOSED

    def _next(self, k: int, must: Array) -> Layer:
        before = self.layers[-1].q
        carried, closed = self._project(before, k)
        closed &= np.abs(carried - before).max(axis=1) <= _CARRIED
        q = self._thinned(must, carried[closed], _ALIKE)
        room = self._most + len(must)
        distance = 0.5 * self.spacing
        while len(q) > room:
            q = self._thinned(must, carried[closed], distance)
            distance *= _COARSER
        if len(q) and len(q) < room:
            q = np.vstack([q, self._beside(q, k)])[:room]
        carried[~closed] = np.nan
        return Layer(q, carried, self._moves(before, carried, q, k))

    def _beside(self, q: Array, k: int) -> Array:
        """Closed postures a spacing beside those of which nothing is there."""
        tangents = self._tangents(q, k)
        steps = self.spacing * np.concatenate([tangents, -tangents], axis=1)
        drawn = (q[:, None] + steps).reshape(-1, q.shape[1])
        drawn = drawn[np.all((drawn >= self._lower) & (drawn <= self._upper), axis=1)]
        drawn = drawn[self._clear_of(q, drawn, 0.7 * self.spacing)]
        if len(drawn) == 0:
            return drawn
        ends, closed = self._project(drawn, k)
        closed &= np.abs(ends - drawn).max(axis=1) <= self.spacing
        return self._thinned(q, ends[closed], 0.5 * self.spacing)[len(q) :]

    def _tangents(self, q: Array, k: int) -> Array:
        """Orthonormal directions of the self-motion, (count, n − m, n)."""
        _, J = self._kernels.residual(q, self._course.goals[self._i][k])
        Q = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0]
        return Q[:, :, self._kernels.m :].swapaxes(1, 2)

    def _clear_of(self, known: Array, q: Array, distance: float) -> Mask:
        """Which postures have none of the known ones within a distance."""
        places, there = (self._cell.embedded(self._i, x) for x in (q, known))
        square = (places**2).sum(axis=1)[:, None] + (there**2).sum(axis=1) - 2 * places @ there.T
        near = square <= distance**2
        # What is a whole turn away is near only for a joint without limits.
        if near.any() and not self.unlimited.all():
            rows, columns = np.nonzero(near)
            far = np.abs(self.apart(q[rows], known[columns])).max(axis=1) > np.pi
            near[rows[far], columns[far]] = False
        return np.asarray(~near.any(axis=1))

    def _thinned(self, known: Array, q: Array, distance: float) -> Array:
        """The known postures and, in their order, those that keep a distance from all before."""
        q = q[self._clear_of(known, q, distance)] if len(known) and len(q) else q
        if len(q) == 0:
            return np.vstack([known, q])
        rows, columns = self._near(q, q, distance)
        edges = np.searchsorted(rows, np.arange(len(q) + 1))
        free = np.ones(len(q), dtype=bool)
        chosen = []
        for row in range(len(q)):
            if free[row]:
                chosen.append(row)
                free[columns[edges[row] : edges[row + 1]]] = False
        return np.vstack([known, q[chosen]])

    def _near(self, q: Array, others: Array, distance: float) -> tuple[Indices, Indices]:
        """Which postures are within a distance of which others, by numbers; rows ascend."""
        # Chords are no longer than arcs, and products of matrices are quick but for rounding.
        places, there = (self._cell.embedded(self._i, x) for x in (q, others))
        square = (places**2).sum(axis=1)[:, None] + (there**2).sum(axis=1) - 2 * places @ there.T
        rows, columns = np.nonzero(square <= distance**2 + _ROUNDED)
        near = np.linalg.norm(self.apart(q[rows], others[columns]), axis=1) <= distance
        return rows[near], columns[near]

    def _moves(self, before: Array, carried: Array, q: Array, k: int) -> Array:
        moves = np.full((len(before), *q.shape), np.nan)
        closed = np.flatnonzero(np.isfinite(carried[:, 0]))
        if len(q) == 0 or len(closed) == 0:
            return moves
        # Tangents where something is near.
        rows, columns = self._near(carried[closed], q, _BESIDE * self.spacing)
        tangents = self._tangents(carried[closed], k)[rows]
        rows = closed[rows]
        offset = self.apart(q[columns], carried[rows])
        along = np.linalg.norm((tangents @ offset[:, :, None])[:, :, 0], axis=1)
        length = np.linalg.norm(offset, axis=1)
        aside = np.sqrt(np.maximum(length**2 - along**2, 0.0))
        fine = (aside <= _ASLANT * length) | (length <= 5 * _ALIKE)
        rows, columns = rows[fine], columns[fine]
        moves[rows, columns] = self.apart(q[columns], before[rows])
        return moves

    def reached(self) -> list[Mask]:
        """Which postures of each layer can be reached from the first layer's."""
        reached = [np.ones(len(self.layers[0].q), dtype=bool)]
        if self.held[0] is not None:
            reached[0] = np.arange(len(reached[0])) == self.held[0]
        for layer in self.layers[1:]:
            moves = np.isfinite(layer.length)
            reached.append(np.asarray((moves & reached[-1][:, None]).any(axis=0)))
        return reached

    @property
    def through(self) -> bool:
        """Whether there is a way through all layers, to the posture that it has to end in."""
        reached, last = self.reached(), self.held[1]
        if len(reached) < len(self._course) or not reached[-1].any():
            return False
        return last is None or bool(reached[-1][last])

    def branches(self, most: int, *, returns: bool) -> list[Indices]:
        """Numbers of the postures of all ways through the layers, (layers,) each; none where there
        are more than so many.

        Args:
            most: of them.
            returns: whether a way ends in the posture that it begins with.
        """
        first, last = self.held
        ends = self.ends() if returns else None
        begun = [k for k in range(len(self.layers[0].q)) if first is None or k == first]
        ways = [[k] for k in begun if ends is None or ends[k] >= 0]
        for layer in self.layers[1:]:
            moves = np.isfinite(layer.length)
            ways = [[*way, int(k)] for way in ways for k in np.flatnonzero(moves[way[-1]])]
            if len(ways) > most:
                return []
        return [
            np.array(way) for way in ways
            if (last is None or way[-1] == last) and (ends is None or way[-1] == ends[way[0]])
        ]  # fmt: skip

    def ends(self) -> Indices:
        """Numbers of the first layer's postures in the last layer, −1 where one is not in it."""
        found = [self._number(self.layers[-1].q, q) for q in self.layers[0].q]
        return np.array([-1 if number is None else number for number in found], dtype=np.intp)
