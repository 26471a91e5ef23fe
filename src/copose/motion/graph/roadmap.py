"""An arm's self-motions along a course: postures layer by layer, and the moves between them.

With the object on its way an arm's self-motion changes from layer to layer. Its postures are
followed along, what opens up is filled from neighbours, and a posture has moves only to those of
the next layer that are near the one it is carried to: a branch is never jumped.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.motion.path.knots import Course
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.posture.search.effort import EFFORTS
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler


@dataclass(frozen=True)
class RoadmapOptions:
    """Options of a roadmap; distances are of joints, rad or m."""

    spacing: float = 0.2  # between postures along a self-motion
    alike: float = 0.02  # distance below which two postures are one
    carried_apart: float = 1.7  # spacings that a posture may move from where it is carried to,
    aslant: float = 0.5  # and what part of that off the tangent of the self-motion
    carried: float = 1.0  # most that a posture is carried from one layer to the next
    most: int = 120  # postures of a layer, with one degree of freedom to spare,
    most_surface: int = 200  # and with more
    drawn: int = 480  # postures from which those of the first layer are chosen
    coarser: float = 1.25  # factor by which spacings grow where there would be more
    rounded: float = 1e-9  # error of squared distances
    from_start: int = 2  # times more postures that there may be around one to start from


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
    def _moved(self) -> tuple[Indices, Indices]:
        """Numbers of the postures before and after every move."""
        rows, columns = np.nonzero(np.isfinite(self.moves[:, :, 0]))
        return rows, columns

    @cached_property
    def length(self) -> Array:
        """‖Δq‖² of the moves, infinite where there is none, (count before, count)."""
        return self._filled((self.moves[self._moved] ** 2).sum(axis=1))

    def pace(self, velocity: Array) -> Array:
        """The least time of every move, s, infinite where there is none, (count before, count)."""
        return self._filled((np.abs(self.moves[self._moved]) / velocity).max(axis=1))

    def _filled(self, values: Array) -> Array:
        filled = np.full(self.moves.shape[:2], np.inf)
        filled[self._moved] = values
        return filled


class Roadmap:
    """The roadmap of one arm: its layers, first to last.

    Attributes:
        layers: one for each instant of the course, as far as there are postures.
        spacing: between postures along a self-motion, rad or m.
        spare: degrees of freedom that it has to spare.
        simple: whether these are no more than one.
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
        best: Array | None = None,
        options: RoadmapOptions = RoadmapOptions(),
    ) -> None:
        """Follow arm i along the object's path.

        Args:
            model: what is built.
            course: the layers' instants.
            i: the arm.
            seed: of what is drawn.
            start: the posture that it starts in, (n,), closed.
            goal: the posture that it ends in, alike.
            returns: whether it ends in the posture that it began with.
            finer: how many times nearer to each other postures of a curve are than they need be.
            best: postures that the first layer has where there is no start, (count, n).
            options: of the roadmap.
        """
        self._options = options
        self._cell, self._kernels, self._i = model.cell, model.arms[i], i
        self._course, arm = course, model.cell.arms[i]
        self._lower, self._upper = model.cell.lower[i], model.cell.upper[i]
        self.unlimited = np.array(
            [j.kind == "revolute" and not np.isfinite([j.lower, j.upper]).any() for j in arm.joints]
        )
        self.spare = 0 if arm.fixed else self._kernels.n - self._kernels.m
        self.simple = self.spare <= 1
        self._most = options.most if self.simple else options.most_surface
        finer = finer if self.simple else 1
        self.spacing, self._most = options.spacing / finer, finer * self._most
        self.held: list[int | None] = [None, None]
        nothing = np.zeros((0, self._kernels.n))
        first = self._first(start, nothing if best is None else best, seed)
        ends = nothing if goal is None else goal[None]
        if goal is None and returns:
            ends = first if self.held[0] is None else first[[self.held[0]]]
        self.layers = [Layer(first, nothing, np.zeros((0, len(first), self._kernels.n)))]
        for k in range(1, len(course)):
            if len(self.layers[-1].q) == 0:
                break
            self.layers.append(self._next(k, ends if k == len(course) - 1 else nothing))
        if goal is not None:
            self.held[1] = self._number(self.layers[-1].q, goal)

    def _first(self, start: Array | None, best: Array, seed: int) -> Array:
        """Postures of the first layer; the start, or else the best, come first, and are followed
        whatever is beside them.
        """
        if start is None:
            known, closed = self._project(best, 0)
            known = known[closed]
        else:
            self.held[0], known = 0, start[None]
            if self.simple:
                # What is on no curve with it can never be reached.
                return self._grown(known, self._options.from_start * self._most)
        q = np.vstack([known, self._sampled(seed)])
        return q[self._thinned(q[:0], q, self._options.alike)]

    @property
    def count(self) -> int:
        """The number of postures in all layers."""
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
        """Postures of the first layer, drawn and thinned."""
        effort = EFFORTS["normal"]
        goal = self._course.goals[self._i][0]
        sampler = ArmSampler(self._cell, self._kernels, self._i, goal)
        rng = np.random.default_rng([seed, self._i])
        options = self._options
        sample = sampler.sample(rng, effort.batch, effort.batches, options.drawn, effort.insistence)
        q = sample.closed[self._thinned(sample.closed[:0], sample.closed, 0.5 * self.spacing)]
        while len(q) > self._most:
            # Long self-motions are sampled more coarsely, not in part.
            self.spacing *= options.coarser
            q = q[self._thinned(q[:0], q, 0.5 * self.spacing)]
        # The sample may be coarser than what bodies leave.
        return q if self.spacing >= options.spacing else self._grown(q, self._most)

    def _grown(self, q: Array, most: int) -> Array:
        """Postures of the first layer that given ones spread to along their self-motions."""
        while len(q) and len(q) < most:
            added = self._next_to(q, self._tangents(q, 0), 0)
            if not len(added):
                break
            q = np.vstack([q, added])
        return q[:most]

    def _number(self, q: Array, posture: Array) -> int | None:
        """The number of a posture among others; None where it is not among them."""
        apart = np.abs(self.apart(q, posture)).max(axis=1, initial=0.0)
        return int(apart.argmin()) if len(q) and apart.min() < 1e-6 else None

    def _project(self, q: Array, k: int) -> tuple[Array, Mask]:
        """Postures projected onto the closed chain of layer k, and a mask of those that close."""
        goal = self._course.goals[self._i][k]
        ends, gaps = project(
            self._kernels, q, goal, self._lower, self._upper, steps=12, closed=0.1 * CLOSED
        )
        return ends, gaps <= CLOSED

    def _next(self, k: int, must: Array) -> Layer:
        before, options = self.layers[-1].q, self._options
        carried, closed = self._project(before, k)
        closed &= np.abs(carried - before).max(axis=1) <= options.carried
        carried[~closed] = np.nan
        many, known = carried[closed], len(must)
        tangents = self._tangents(np.vstack([must, many]), k)
        kept, distance = self._thinned(must, many, options.alike), 0.5 * self.spacing
        while len(kept) > self._most:
            kept = self._thinned(must, many, distance)
            distance *= options.coarser
        q = np.vstack([must, many[kept]])
        if 0 < len(q) < self._most + known:
            own = np.concatenate([tangents[:known], tangents[known + kept]])
            q = np.vstack([q, self._next_to(q, own, k)])[: self._most + known]
        return Layer(q, carried, self._moves(before, carried, tangents[known:], q))

    def _next_to(self, q: Array, tangents: Array, k: int) -> Array:
        """Closed postures a spacing from others, along self-motions, where there are none yet."""
        steps = self.spacing * np.concatenate([tangents, -tangents], axis=1)
        drawn = (q[:, None] + steps).reshape(-1, q.shape[1])
        drawn = drawn[np.all((drawn >= self._lower) & (drawn <= self._upper), axis=1)]
        drawn = drawn[self._clear_of(q, drawn, 0.7 * self.spacing)]
        if len(drawn) == 0:
            return drawn
        ends, closed = self._project(drawn, k)
        closed &= np.abs(ends - drawn).max(axis=1) <= self.spacing
        return ends[closed][self._thinned(q, ends[closed], 0.5 * self.spacing)]

    def _tangents(self, q: Array, k: int) -> Array:
        """Orthonormal directions of the self-motion, (count, n − m, n)."""
        _, J = self._kernels.residual(q, self._course.goals[self._i][k])
        Q = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0]
        return Q[:, :, self._kernels.m :].swapaxes(1, 2)

    def _clear_of(self, known: Array, q: Array, distance: float) -> Mask:
        """A mask of postures that have none of the known ones within a distance."""
        near = self._squares(q, known) <= distance**2
        # What is a whole turn away is near only for a joint without limits.
        if near.any() and not self.unlimited.all():
            rows, columns = np.nonzero(near)
            far = np.abs(self.apart(q[rows], known[columns])).max(axis=1) > np.pi
            near[rows[far], columns[far]] = False
        return np.asarray(~near.any(axis=1))

    def _thinned(self, known: Array, q: Array, distance: float) -> Indices:
        """Numbers of postures that keep a distance from known ones and from all before them."""
        free = self._clear_of(known, q, distance).tolist()
        rows, columns = self._near(q, q, distance)
        later = columns > rows
        for row, column in zip(rows[later].tolist(), columns[later].tolist(), strict=True):
            free[column] = free[column] and not free[row]
        return np.flatnonzero(free)

    def _near(self, q: Array, points: Array, distance: float) -> tuple[Indices, Indices]:
        """Pairs of postures and points within a distance, by number; rows ascend."""
        rows, columns = np.nonzero(self._squares(q, points) <= distance**2 + self._options.rounded)
        near = np.linalg.norm(self.apart(q[rows], points[columns]), axis=1) <= distance
        return rows[near], columns[near]

    def _squares(self, q: Array, points: Array) -> Array:
        """Squared chords between postures, no longer than arcs, (count, count'); rounded, for they
        are products of matrices.
        """
        one = self._cell.embedded(self._i, q)
        other = one if points is q else self._cell.embedded(self._i, points)
        squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * one @ other.T
        return np.asarray(squares)

    def _moves(self, before: Array, carried: Array, tangents: Array, q: Array) -> Array:
        """See `Layer`; ``tangents`` of those carried postures that close."""
        options, moves = self._options, np.full((len(before), *q.shape), np.nan)
        closed = np.flatnonzero(np.isfinite(carried[:, 0]))
        if len(q) == 0 or len(closed) == 0:
            return moves
        near, columns = self._near(carried[closed], q, options.carried_apart * self.spacing)
        rows = closed[near]
        offset = self.apart(q[columns], carried[rows])
        along = np.linalg.norm((tangents[near] @ offset[:, :, None])[:, :, 0], axis=1)
        length = np.linalg.norm(offset, axis=1)
        aside = np.sqrt(np.maximum(length**2 - along**2, 0.0))
        fine = (aside <= options.aslant * length) | (length <= 5 * options.alike)
        rows, columns = rows[fine], columns[fine]
        moves[rows, columns] = self.apart(q[columns], before[rows])
        return moves

    def reached(self) -> list[Mask]:
        """Masks of the postures of each layer that can be reached from the first layer's."""
        reached = [np.ones(len(self.layers[0].q), dtype=bool)]
        if self.held[0] is not None:
            reached[0] = np.arange(len(reached[0])) == self.held[0]
        for layer in self.layers[1:]:
            moves = np.isfinite(layer.length)
            reached.append(np.asarray((moves & reached[-1][:, None]).any(axis=0)))
        return reached

    @property
    def through(self) -> bool:
        """True where there is a way through all layers, to the posture that it has to end in."""
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
        numbers = [self._number(self.layers[-1].q, q) for q in self.layers[0].q]
        return np.array([-1 if number is None else number for number in numbers], dtype=np.intp)
