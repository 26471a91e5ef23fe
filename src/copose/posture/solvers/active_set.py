"""An active-set method on closed chains, many starts at once: Newton steps along self-motions.

The posture program with its closure solved for: every block of variables moves in its own tangent
space, Newton's Hessian is that of the Lagrangian in these few directions, variables that limits
stop are held there as long as their multipliers push outwards. Written out because no library takes
steps on closed chains in batches, and IPOPT takes longer to start than this to end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.selection import far_apart_rows
from copose.self_motion.tangent_space import Tangent


@dataclass(frozen=True)
class NewtonOptions:
    """Steps and tolerances of the active-set method."""

    tolerance: float = 1e-9  # of optimality, scaled as IPOPT's
    scale: float = 100.0  # of multipliers from which on that scaling sets in
    iterations: int = 60  # steps at most
    shrink: float = 0.25  # of a step that does not ascend
    shrinkings: int = 6  # at most
    longest: float = 0.3  # rad or m that a joint moves in one step
    difference: float = 1e-6  # rad or m, step of finite differences
    at_limit: float = 1e-10  # rad or m, that a joint is off a limit that it is brought to
    flattest: float = 1e-8  # curvature, relative to the largest, that counts as this much
    noise: float = 1e-10  # that a value may be off where a chain is open by a little, relative
    closed: float = 1e-11  # m or rad, to which chains are closed
    damping: float = 1e-12  # of these, relative
    closing: int = 6  # steps at most that close chains with what is free
    alike: float = 0.02  # rad or m, climbs of a race that are so near each other are one
    promise: float = 0.3  # that a Newton step promises of the objective, at most, counts in a race


@dataclass(frozen=True, eq=False)
class Polished:
    """Ends of climbs.

    Attributes:
        q: joints of all arms, (count, N).
        value: of the score, (count,).
        error: IPOPT's measure of optimality there, infinite where a race was lost, (count,).
        met: how many starts led to each: where a race makes climbs one, of all of these, (count,).
        tolerance: of the error.
    """

    q: Array
    value: Array
    error: Array
    met: Indices
    tolerance: float

    @property
    def converged(self) -> Mask:
        """A mask of the ends that meet IPOPT's tolerance, (count,)."""
        return np.asarray(self.error <= self.tolerance)


@dataclass(frozen=True, eq=False)
class Iterates:
    """Closed postures of climbs and all that their next steps take from them.

    Attributes:
        q: by block, (count, k, n).
        held: by block, variables that are taken to be stopped, (count, k, n).
        value: (count,).
        known: what else has been evaluated there, (count, …) each.
    """

    q: list[Array]
    held: list[Mask]
    value: Array
    known: list[Array]

    def taken(self, rows: Mask) -> Iterates:
        """The postures of some starts."""
        if rows.all():
            return self
        return Iterates(
            [q[rows] for q in self.q],
            [held[rows] for held in self.held],
            self.value[rows],
            [known[rows] for known in self.known],
        )

    def put(self, rows: Indices, other: Iterates, chosen: Mask) -> None:
        """Replace some of these starts by chosen ones of another."""
        for known, new in (
            *zip(self.q, other.q, strict=True),
            *zip(self.held, other.held, strict=True),
            *zip(self.known, other.known, strict=True),
            (self.value, other.value),
        ):
            known[rows] = new[chosen]


class Block(Protocol):
    """Variables that have a tangent space of their own, k alike side by side."""

    @property
    def columns(self) -> Indices:
        """Columns of each among all variables, (k, n)."""

    @property
    def lower(self) -> Array:
        """Lower bounds, infinite where there is none, (k, n)."""

    @property
    def upper(self) -> Array:
        """Upper bounds, alike."""


@dataclass(frozen=True, eq=False)
class ActiveSet(ABC):
    """An active-set method in the tangent spaces of closed chains.

    Attributes:
        blocks: of the variables that move.
        options: steps and tolerances.
    """

    blocks: Sequence[Block]
    options: NewtonOptions

    @abstractmethod
    def point(self, q: list[Array], held: list[Mask]) -> Iterates:
        """Evaluate closed postures by block, with variables that are taken to be stopped."""

    @abstractmethod
    def tangent(self, j: int, point: Iterates, held: Mask) -> Tangent:
        """The tangent spaces of a block with variables held, (rows, n)."""

    @abstractmethod
    def direction(self, point: Iterates, tangents: list[Tangent]) -> list[Array]:
        """A Newton step in the tangent spaces that ascends, by block, (count, k, n)."""

    @abstractmethod
    def closed(self, j: int, q: Array, lower: Array, upper: Array) -> tuple[Array, Mask]:
        """A block's variables, (count, k, n), projected within bounds, and which starts close."""

    def polish(self, q: Array, race: Sequence[tuple[int, int]] = ()) -> Polished:
        """Climb from closed postures, (count, N), to local maxima.

        Args:
            q: where climbs start.
            race: after so many steps no more than so many climbs go on: those that differ and
                promise most.
        """
        value, error = np.full(len(q), -np.inf), np.full(len(q), np.inf)
        met = np.ones(len(q), dtype=np.intp)
        ends, kept = Polished(q.copy(), value, error, met, self.options.tolerance), dict(race)

        def settle(done: Mask, error: Array) -> None:
            for block, part in zip(self.blocks, point.q, strict=True):
                ends.q[rows[done][:, None, None], block.columns] = part[done]
            ends.value[rows[done]], ends.error[rows[done]] = point.value[done], error[done]

        parts = [q[:, block.columns] for block in self.blocks]
        stopped = [_stopped(block, part) for block, part in zip(self.blocks, parts, strict=True)]
        point = self.point(parts, stopped)
        sound = np.isfinite(point.value)
        rows, point = sound.nonzero()[0], point.taken(sound)
        for left in range(self.options.iterations, -1, -1):
            if len(rows) == 0:
                break
            tangents = [self._tangent(j, point) for j in range(len(self.blocks))]
            error = self._error(tangents, len(rows))
            done = (error <= self.options.tolerance) | (left == 0)
            if done.any():
                settle(done, error)
                going = ~done
                rows, point, error = rows[going], point.taken(going), error[going]
                if len(rows) == 0:
                    break
                tangents = self._taken(tangents, going)
            tangents, direction = self._feasible_direction(point, tangents)
            if self.options.iterations - left in kept:
                most = kept[self.options.iterations - left]
                leads = self._leading(point, tangents, direction, most, rows, ends.met)
                settle(~leads, np.full(len(rows), np.inf))
                rows, point, error = rows[leads], point.taken(leads), error[leads]
                direction = [step[leads] for step in direction]
                tangents = self._taken(tangents, leads)
            ahead, moved = self._advance(point, tangents, direction)
            if not moved.all():
                settle(~moved, error)
            rows, point = rows[moved], ahead.taken(moved)
        return ends

    def _tangent(self, j: int, point: Iterates) -> Tangent:
        """The tangent spaces of a block; what gains by leaving its limit is let go."""
        block, q, held = self.blocks[j], point.q[j], point.held[j]
        shape = (-1, q.shape[2])
        if not held.any():
            return self.tangent(j, point, held.reshape(shape))
        above, below = q >= block.upper, q <= block.lower
        outward = (above.astype(float) - below).reshape(shape)
        held = (held & (above | below)).reshape(shape)
        return self.tangent(j, point, held).released(outward)

    def _taken(self, tangents: list[Tangent], rows: Mask) -> list[Tangent]:
        """The tangent spaces of some starts."""
        if rows.all():
            return tangents
        return [
            tangent.taken(np.repeat(rows, len(block.columns)))
            for block, tangent in zip(self.blocks, tangents, strict=True)
        ]

    def _leading(
        self,
        point: Iterates,
        tangents: list[Tangent],
        direction: list[Array],
        most: int,
        rows: Indices,
        met: Indices,
    ) -> Mask:
        """A mask of the climbs that promise most and differ; others near to one count as met there.

        Args:
            point: where climbs are.
            tangents: there.
            direction: of their next steps.
            most: climbs that go on.
            rows: their numbers among all.
            met: starts that have led to each of all; grows.
        """
        count, gain = len(rows), np.zeros(len(rows))
        for tangent, step in zip(tangents, direction, strict=True):
            gain += (tangent.slope.reshape(step.shape) * step).sum(axis=(1, 2))
        worth = point.value + np.minimum(gain / 2, self.options.promise)
        q = np.hstack([part.reshape(count, -1) for part in point.q])
        order = np.argsort(-worth, kind="stable")
        apart = far_apart_rows(
            np.ones(count, dtype=bool),
            lambda row, _: np.abs(q[order] - q[order[row]]).max(axis=1) <= self.options.alike,
            most,
        )
        leads = np.zeros(count, dtype=bool)
        leads[order[apart]] = True
        leading, rest = np.flatnonzero(leads), np.flatnonzero(~leads)
        distances = np.abs(q[rest][:, None] - q[leading]).max(axis=2)
        joins = distances.min(axis=1) <= self.options.alike
        np.add.at(met, rows[leading[distances.argmin(axis=1)[joins]]], met[rows[rest[joins]]])
        return leads

    def _error(self, tangents: list[Tangent], count: int) -> Array:
        """IPOPT's scaled dual infeasibility, (count,).

        The largest entry of ∇f + Jᵀλ − z with least-squares multipliers, over
        max(100, mean |λ|, |z|)/100 (A. Wächter, L. T. Biegler, 2006, eq. 5).
        """
        largest, total, entries = 0.0, 0.0, 0
        for tangent in tangents:
            left = np.abs(tangent.left)
            rest = np.where(tangent.held, 0.0, left).reshape(count, -1)
            largest = np.maximum(largest, rest.max(axis=1))
            forces = np.abs(tangent.forces).reshape(count, -1)
            total = total + forces.sum(axis=1)
            total += (left.reshape(count, -1) - rest).sum(axis=1)
            entries += rest.shape[1] + forces.shape[1]
        return np.asarray(largest / np.maximum(1.0, total / entries / self.options.scale))

    def _feasible_direction(
        self, point: Iterates, tangents: list[Tangent]
    ) -> tuple[list[Tangent], list[Array]]:
        """A direction that pushes nothing through its limit, and the tangent spaces it is of."""
        direction = self.direction(point, tangents)
        if not any(held.any() for held in point.held):
            return tangents, direction
        for _ in range(max(block.columns.shape[1] for block in self.blocks)):
            pushed = [
                ((q >= block.upper) & (step > 0) | (q <= block.lower) & (step < 0))
                & ~tangent.held.reshape(step.shape)
                for block, q, step, tangent in zip(
                    self.blocks, point.q, direction, tangents, strict=True
                )
            ]
            rows = np.any([push.any(axis=(1, 2)) for push in pushed], axis=0)
            if not rows.any():
                break
            tangents = [
                tangent.holding(push.reshape(tangent.held.shape))
                for tangent, push in zip(tangents, pushed, strict=True)
            ]
            again = self.direction(point.taken(rows), self._taken(tangents, rows))
            for step, new in zip(direction, again, strict=True):
                step[rows] = new
        return tangents, direction

    def _advance(
        self, point: Iterates, tangents: list[Tangent], direction: list[Array]
    ) -> tuple[Iterates, Mask]:
        """Go along the direction as far as limits allow and the value grows.

        Returns:
            The new postures, and which of them moved.
        """
        count, longest = len(point.value), self.options.longest
        reach, gain = np.ones(count), np.zeros(count)
        held = []
        for j, (block, step) in enumerate(zip(self.blocks, direction, strict=True)):
            size = np.abs(step)
            reach = np.minimum(reach, longest / np.maximum(size.max(axis=(1, 2)), longest))
            room = np.where(step > 0, block.upper - point.q[j], point.q[j] - block.lower)
            part = np.full_like(step, np.inf)
            np.divide(np.maximum(room, 0.0), size, out=part, where=size > 1e-200)
            reach = np.minimum(reach, part.min(axis=(1, 2)))
            gain += (tangents[j].slope.reshape(step.shape) * step).sum(axis=(1, 2))
            held.append(tangents[j].held.reshape(step.shape))
        noise = self.options.noise * (1 + np.abs(point.value))
        closed, ahead = self._retracted(point.q, direction, reach, held)
        moved = closed & (ahead.value >= point.value + 1e-4 * reach * gain - noise)
        trying = (~moved).nonzero()[0]
        for _ in range(self.options.shrinkings):
            if len(trying) == 0:
                break
            reach[trying] *= self.options.shrink
            closed, trial = self._retracted(
                [q[trying] for q in point.q], [step[trying] for step in direction], reach[trying],
                [each[trying] for each in held],
            )  # fmt: skip
            required = (point.value + 1e-4 * reach * gain - noise)[trying]
            good = closed & (trial.value >= required)
            ahead.put(trying[good], trial, good)
            moved[trying[good]] = True
            trying = trying[~good]
        return ahead, moved

    def _retracted(
        self, q: list[Array], direction: list[Array], reach: Array, held: list[Mask]
    ) -> tuple[Mask, Iterates]:
        """Postures after a step, closed again, with held variables where they are."""
        ends, stops, near = [], [], self.options.at_limit
        closed = np.ones(len(reach), dtype=bool)
        for j, block in enumerate(self.blocks):
            guess, stop = q[j] + reach[:, None, None] * direction[j], held[j]
            low, high = guess < block.lower + near, guess > block.upper - near
            if low.any() or high.any():
                guess = np.where(low, block.lower, np.where(high, block.upper, guess))
                # What a step of full reach brings to its limit stays there.
                stop = stop | ((low | high) & ~_stopped(block, q[j]))
            lower, upper = block.lower, block.upper
            if stop.any():
                lower, upper = np.where(stop, guess, lower), np.where(stop, guess, upper)
            end, closes = self.closed(j, guess, lower, upper)
            closed &= closes
            ends.append(end)
            stops.append(stop | _stopped(block, end))
        return closed, self.point(ends, stops)


def _stopped(block: Block, q: Array) -> Mask:
    """A mask of the variables at a limit, (count, k, n)."""
    return np.asarray((q <= block.lower) | (q >= block.upper))


def ascent(H: Array, gradient: Array, flattest: float) -> Array:
    """Newton's step for a maximum, with the Hessian's eigenvalues made negative, (count, D)."""
    H = (H + H.transpose(0, 2, 1)) / 2
    sound = np.isfinite(H).all(axis=(1, 2))
    if not sound.all():
        H[~sound] = -np.eye(H.shape[1])
    values, vectors = np.linalg.eigh(H)
    size = np.abs(values)
    size = np.maximum(size, flattest * np.maximum(size.max(axis=1, keepdims=True), 1.0))
    along = (vectors.transpose(0, 2, 1) @ gradient[:, :, None])[:, :, 0]
    return np.asarray((vectors @ (along / size)[:, :, None])[:, :, 0])
