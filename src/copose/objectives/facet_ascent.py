"""Local maxima of the largest ball of accelerations along the arms' self-motions.

A facet moves smoothly with the posture as long as it is parallel to the same generators. So each
of the nearest has a quadratic model, and a step goes to the largest minimum of these models within
a trust region.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from copose.capability.residual_balls import ResidualBalls, row_by_row
from copose.objectives.quadratic_maximin import Quadratics, maximin
from copose.poses import Array, Indices, Mask
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class AscentOptions:
    """Steps of the ascent."""

    facets: int = 16  # nearest facets that are followed
    also: int = 8  # facets of the step before that are
    region: float = 0.15  # first trust region, rad or m
    widest: float = 0.3  # trust region, at most
    difference: float = 2e-5  # step of differences, rad or m: facets have kinks nearby
    smallest: float = 1e-9  # trust region that is the end
    steps: int = 60  # at most
    gain: float = 1e-12  # predicted, relative, that is the end
    hope: float = 10.0  # times the gain predicted last that a start may gain to come up to the best
    steeper: float = 30.0  # times the steepest facet, that limits fall beyond joint positions
    still: float = 1e-6  # rate of a joint, or slope of a facet, that counts as none
    tie: float = 1e-9  # of the best, relative, within which none falls behind


@dataclass(frozen=True, eq=False)
class _Climbers:
    """Postures on their way up."""

    number: Indices  # of the start, (count,)
    q: list[Array]  # by arm, (count, n_i)
    value: Array  # radius there, (count,)
    choices: Indices  # generators of the facets that are followed, (count, k, m − 1)
    region: Array  # half the width of the trust region, rad or m, (count,)
    gain: Array  # predicted last, (count,)
    done: Mask  # no better posture is in sight, (count,)

    def taken(self, rows: Mask) -> _Climbers:
        """Some of them."""
        return _Climbers(
            self.number[rows], [q[rows] for q in self.q], self.value[rows], self.choices[rows],
            self.region[rows], self.gain[rows], self.done[rows],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class FacetAscent:
    """An ascent from many postures at once.

    Attributes:
        balls: of postures by arm, (count, n_i).
        arms: manifolds of their closed postures, (1, n_i); None for arms that do not move.
    """

    balls: Callable[[Sequence[Array]], ResidualBalls]
    arms: Sequence[ClosureManifold | None]
    options: AscentOptions = AscentOptions()

    @property
    def _moving(self) -> list[int]:
        return [i for i, arm in enumerate(self.arms) if arm is not None and arm.spare > 0]

    def ends(self, q: Sequence[Array], *, race: bool) -> list[Array]:
        """Ends of ascents from closed postures, by arm (count, n_i).

        Args:
            q: where they start.
            race: whether those that fall behind are given up: their ends are NaN.
        """
        climbers, best = self._starting(q), -np.inf
        ends = [np.full_like(part, np.nan) for part in q]
        for _ in range(self.options.steps if self._moving else 0):
            if not len(climbers.number):
                break
            climbers = self._stepped(climbers)
            best = max(best, climbers.value.max(initial=-np.inf))
            if race:
                tie = self.options.tie * abs(best)
                climbers = climbers.taken(
                    climbers.value + self.options.hope * climbers.gain >= best - tie
                )
            _written(ends, climbers.taken(climbers.done))
            climbers = climbers.taken(~climbers.done)
        _written(ends, climbers)
        return ends

    def _starting(self, q: Sequence[Array]) -> _Climbers:
        """The climbers at their starts, but for those where the motion is singular."""
        options, count = self.options, len(q[0])
        facets = self.balls(q).facets(row_by_row(count, len(q)), options.facets + options.also)
        whole = np.full(count, np.inf)
        climbers = _Climbers(
            np.arange(count), list(q), facets.radii[:, 0], facets.choices,
            np.full(count, options.region), whole, np.zeros(count, dtype=bool),
        )  # fmt: skip
        return climbers.taken(np.isfinite(climbers.value))

    def _stepped(self, climbers: _Climbers) -> _Climbers:
        """One step of each: to where the models of the facets are best, if that is better."""
        options = self.options
        tangents = self._tangents(climbers.q)
        models = self._models(climbers, tangents)
        steepest = np.linalg.norm(models.slope, axis=1).max(axis=1)
        limits = self._limits(climbers, tangents, steepest)
        x, gain = maximin(models.joined(limits), climbers.region)
        q, closed = self._moved(climbers.q, tangents, x, limited=True)
        facets = self.balls(q).facets(row_by_row(len(x), len(q)), options.facets)
        value = np.where(closed, facets.radii[:, 0], -np.inf)
        better = value > climbers.value
        done = gain <= options.gain * (1 + np.abs(climbers.value))
        done |= ~better & (climbers.region <= options.smallest)
        good = value - climbers.value > gain / 2
        region = climbers.region * np.where(better, np.where(good, 2.0, 0.5), 0.25)
        rows = better[:, None]
        choices = _chosen(rows, facets.choices, climbers.choices, options.also)
        return _Climbers(
            climbers.number,
            [np.where(rows, new, old) for new, old in zip(q, climbers.q, strict=True)],
            np.where(better, value, climbers.value),
            choices,
            np.minimum(region, options.widest),
            gain,
            done,
        )

    def _tangents(self, q: Sequence[Array]) -> list[Array]:
        """Orthonormal tangents of the self-motions of each arm that moves, (count, n_i, d_i)."""
        tangents = []
        for i in self._moving:
            arm = self._arm(i)
            _, J = arm.kernels.residual(q[i], arm.goals[0])
            Q, _ = np.linalg.qr(J.swapaxes(1, 2), mode="complete")
            tangents.append(Q[:, :, arm.kernels.m :])
        return tangents

    def _moved(
        self, q: Sequence[Array], tangents: Sequence[Array], x: Array, *, limited: bool
    ) -> tuple[list[Array], Mask]:
        """Postures so far along the tangents, (count, d), closed again, within limits or without
        regard to them; and which are closed.
        """
        moved, closed = list(q), np.ones(len(x), dtype=bool)
        edges = np.cumsum([tangent.shape[2] for tangent in tangents])[:-1]
        parts = np.split(x, edges, axis=1)
        for i, tangent, part in zip(self._moving, tangents, parts, strict=True):
            arm = self._arm(i)
            free = np.full(arm.kernels.n, np.inf)
            limits = (arm.lower[0], arm.upper[0]) if limited else (-free, free)
            moved[i], gaps = project(
                arm.kernels, q[i] + _along(tangent, part), arm.goals[0], *limits, steps=12
            )
            closed &= gaps <= CLOSED
        return moved, closed

    def _models(self, climbers: _Climbers, tangents: Sequence[Array]) -> Quadratics:
        """Models of the facets' distances in terms of the ways along the tangents."""
        d, count = sum(tangent.shape[2] for tangent in tangents), len(climbers.value)
        h = np.minimum(self.options.difference, climbers.region)
        x = (h[:, None, None] * _stencil(d)).reshape(-1, d)
        rows = np.repeat(np.arange(count), len(x) // count)
        q, _ = self._moved(
            [part[rows] for part in climbers.q], [t[rows] for t in tangents], x, limited=False
        )
        balls = self.balls(q)
        values = balls.tracked(row_by_row(len(rows), len(q)), climbers.choices[rows])
        return _fitted(values.reshape(count, len(x) // count, -1), d, h)

    def _limits(self, climbers: _Climbers, tangents: Sequence[Array], slope: Array) -> Quadratics:
        """Joint limits as functions that fall from the radius where they are met, so steeply that a
        gain ends within them; they are met in the end.

        Args:
            climbers: at their postures.
            tangents: there.
            slope: of the steepest facet, (count,).
        """
        values, slopes, column = [], [], 0
        d = sum(tangent.shape[2] for tangent in tangents)
        for i, tangent in zip(self._moving, tangents, strict=True):
            arm, q = self._arm(i), climbers.q[i]
            rates = np.zeros((*q.shape, d))
            rates[:, :, column : column + tangent.shape[2]] = tangent
            column += tangent.shape[2]
            size = np.maximum(np.linalg.norm(tangent, axis=2), self.options.still)
            steep = self.options.steeper * np.maximum(slope, self.options.still)[:, None]
            for sign, limit in ((1.0, arm.upper), (-1.0, arm.lower)):
                values.append(climbers.value[:, None] + steep * sign * (limit - q) / size)
                slopes.append(-sign * (steep / size)[:, :, None] * rates)
        value, fall = np.concatenate(values, axis=1), np.concatenate(slopes, axis=1)
        return Quadratics(value, fall.swapaxes(1, 2), np.zeros((len(value), d, d, value.shape[1])))

    def _arm(self, i: int) -> ClosureManifold:
        arm = self.arms[i]
        assert arm is not None
        return arm


def _stencil(d: int) -> Array:
    """Points at which quadratic functions of d coordinates are known: 0, ±e_k and e_k + e_j."""
    unit = np.eye(d)
    return np.array([0 * unit[0], *unit, *-unit, *(a + b for a, b in combinations(unit, 2))])


def _fitted(values: Array, d: int, h: Array) -> Quadratics:
    """Quadratic functions from their values at so many times the stencil, (count, points, k)."""
    lost = np.asarray(~np.isfinite(values).all(axis=1))
    values = np.where(lost[:, None], 0.0, values)
    first, up, down, both = np.split(values, [1, 1 + d, 1 + 2 * d], axis=1)
    h = h[:, None, None]
    bend = np.zeros((len(values), d, d, values.shape[2]))
    bend[:, range(d), range(d)] = (up + down - 2 * first) / h**2
    k, j = np.array(list(combinations(range(d), 2)), dtype=np.intp).reshape(-1, 2).T
    bend[:, k, j] = bend[:, j, k] = (both - up[:, k] - up[:, j] + first) / h**2
    return Quadratics(np.where(lost, np.inf, first[:, 0]), (up - down) / (2 * h), bend)


def _chosen(better: Mask, new: Indices, old: Indices, also: int) -> Indices:
    """Choices of facets to follow next: the nearest where a climber is, and a few of the others."""
    also, better = min(also, new.shape[1]), better[:, :, None]
    here = np.where(better, new, old[:, : new.shape[1]])
    return np.concatenate([here, np.where(better, old[:, :also], new[:, :also])], axis=1)


def _along(tangent: Array, x: Array) -> Array:
    """Ways along tangents, (count, n, d), by so much, (count, d): (count, n)."""
    return np.asarray((tangent @ x[:, :, None])[:, :, 0])


def _written(ends: Sequence[Array], climbers: _Climbers) -> None:
    for end, part in zip(ends, climbers.q, strict=True):
        end[climbers.number] = part
