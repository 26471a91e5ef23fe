"""The largest balls of accelerations around rest within torque limits, of many postures at once.

With K τ = S a + r the forward dynamics of the closed chain, see `TorqueReach`, every vector w
bounds the radius by (‖T Kᵀw‖₁ − |wᵀr|) / ‖Sᵀw‖, S on the axes that count; the radius is the least
of these bounds, and it belongs to the normal of a facet. K, S and r are sums over the arms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from copose.capability.facet_normals import FacetNormals, cross
from copose.capability.torque_limits import Dynamics
from copose.poses import Array, Indices, Mask
from copose.progress import heed


@dataclass(frozen=True)
class BallOptions:
    """Sizes of the enumeration, and what counts as nothing."""

    facets: int = 10**5  # choices of generators that are enumerated, at most
    at_once: int = 2**17  # numbers that are worked on together, so as to stay within a cache
    nothing: float = 1e-12  # relative, of normals and of what they are multiplied by


@dataclass(frozen=True, eq=False)
class Facets:
    """The nearest facets of many postures.

    Attributes:
        radii: their distances from rest, (count, k), nearest first; the first is the radius, which
            is negative where rest is outside.
        normals: w, (count, k, m).
        choices: numbers of the generators that they are parallel to, (count, k, m − 1).
    """

    radii: Array
    normals: Array
    choices: Indices


@dataclass(frozen=True, eq=False)
class ResidualBalls:
    """K T, S on some axes and r of many postures: by arm, what each of its own adds.

    Attributes:
        K: K_iT_i, (count_i, m, n_i).
        S: (count_i, m, a).
        r: (count_i, m).
        inertia: M_o on the axes, (m, a).
        weight: (m,).
    """

    K: tuple[Array, ...]
    S: tuple[Array, ...]
    r: tuple[Array, ...]
    inertia: Array
    weight: Array
    options: BallOptions = BallOptions()

    @classmethod
    def of(
        cls, dynamics: Dynamics, inertia: Array, weight: Array, axes: Sequence[int]
    ) -> ResidualBalls:
        """The terms of equations of motion whose moments need not balance.

        From M = LLᵀ and L⁻¹Jᵀ = Q U: Λ = U⁻¹U⁻ᵀ and ΛJM⁻¹ = U⁻¹QᵀL⁻¹.
        """
        K, S, r = [], [], []
        parts = (dynamics.M, dynamics.J, dynamics.g, dynamics.motion, dynamics.balance)
        for M, J, g, X, P, T in zip(*parts, dynamics.limits, strict=True):
            L = _lower(M)
            Q, U = np.linalg.qr(_divided(L, J.swapaxes(1, 2)))
            contact = _divided(U.swapaxes(1, 2), np.broadcast_to(P.T, U.shape)).swapaxes(1, 2)
            motion = _divided(U.swapaxes(1, 2), np.broadcast_to(X, U.shape))
            pushed = contact @ _divided(L.swapaxes(1, 2), Q).swapaxes(1, 2)
            K.append(pushed * T)
            S.append((contact @ motion)[:, :, list(axes)])
            r.append((pushed @ g[:, :, None])[:, :, 0])
        return cls(tuple(K), tuple(S), tuple(r), inertia[:, list(axes)], weight)

    @classmethod
    def enumerable(cls, m: int, n_joints: int) -> bool:
        """True where all facets can be looked at."""
        return math.comb(n_joints, m - 1) <= cls.options.facets

    @property
    def counts(self) -> tuple[int, ...]:
        """Postures by arm."""
        return tuple(map(len, self.K))

    @property
    def _n(self) -> int:
        return sum(K.shape[2] for K in self.K)

    @cached_property
    def _normals(self) -> FacetNormals:
        return FacetNormals.of(len(self.weight), self._n)

    def facets(self, chosen: Indices, most: int = 1) -> Facets:
        """The nearest facets of combinations, by the numbers of the arms' postures, (count, K).

        Radii are NaN where the equations of motion are singular.
        """
        step = max(1, self.options.at_once // (len(self._normals.choices) * self._n))
        parts = [self._nearest(chosen[k : k + step], most) for k in range(0, len(chosen), step)]
        parts = parts or [self._nearest(chosen, most)]
        radii, normals, choices = (np.concatenate(each) for each in zip(*parts, strict=True))
        return Facets(radii, normals, choices)

    def _nearest(self, chosen: Indices, most: int) -> tuple[Array, Array, Indices]:
        heed()
        whitened = self._whitened(chosen)
        normals = self._normals(whitened.even)
        radii = whitened.radii(normals, self.options.nothing)
        most = min(most, radii.shape[1])
        nearest = np.argpartition(radii, most - 1, axis=1)[:, :most]
        order = np.argsort(np.take_along_axis(radii, nearest, axis=1), axis=1, kind="stable")
        nearest = np.take_along_axis(nearest, order, axis=1)
        y = np.take_along_axis(normals, nearest[:, None], axis=2)
        w = _divided(whitened.R, y).swapaxes(1, 2)
        sound = whitened.sound[:, None]
        distances = np.where(sound, np.take_along_axis(radii, nearest, axis=1), np.nan)
        return distances, w, self._normals.choices[nearest]

    def tracked(self, chosen: Indices, choices: Indices) -> Array:
        """Distances of opposite facets parallel to certain generators, (count, k, m − 1), of
        combinations, (count, K): those along normals, then those against them, (count, 2k).
        """
        whitened = self._whitened(chosen)
        rows = np.arange(len(chosen))[:, None, None]
        columns = whitened.even.transpose(1, 0, 2)[:, rows, choices]
        normals = cross(np.moveaxis(columns, -1, 0)).swapaxes(0, 1)
        # The nearer of two opposite facets would have a kink where both are as near.
        both = [
            whitened.radii(normals, self.options.nothing, s) for s in (np.positive, np.negative)
        ]
        return np.where(whitened.sound[:, None], np.hstack(both), np.nan)

    def bounds(self, w: Array, chosen: Indices) -> Array:
        """Least bounds of the radii of combinations, (count, K), by vectors w, (k, m): (count,)."""
        pushed, shift, moved = (
            sum(part[rows] for part, rows in zip(parts, chosen.T, strict=True))
            for parts in self._cuts(w)
        )
        shift, moved = shift + w @ self.weight, moved + w @ self.inertia
        return np.asarray(_ratio(pushed - np.abs(shift), (moved**2).sum(axis=2)).min(axis=1))

    def table(self, w: Array) -> Array:
        """The same of all postures of one arm, (count,), or pairs of two, (count_1, count_2)."""
        least = np.full(self.counts, np.inf)
        pushed, shift, moved = self._cuts(w)
        fixed, still = w @ self.weight, w @ self.inertia
        for k in range(len(w)):
            h, c = pushed[0][:, k], shift[0][:, k] + fixed[k]
            s = moved[0][:, k] + still[k]
            square = (s * s).sum(axis=1)
            if len(pushed) == 2:
                other = moved[1][:, k]
                square = (square[:, None] + (other * other).sum(axis=1)) + 2 * (s @ other.T)
                h, c = h[:, None] + pushed[1][:, k], c[:, None] + shift[1][:, k]
            np.minimum(least, _ratio(h - np.abs(c), square), out=least)
        return least

    def _cuts(self, w: Array) -> tuple[list[Array], list[Array], list[Array]]:
        """‖T_iK_iᵀw‖₁ and wᵀr_i, (count_i, k), and S_iᵀw, (count_i, k, a), by arm."""
        pushed = [np.abs(w @ K).sum(axis=2) for K in self.K]
        return pushed, [r @ w.T for r in self.r], [w @ S for S in self.S]

    def _whitened(self, chosen: Indices) -> _Whitened:
        K, S, r = (
            [part[rows] for part, rows in zip(parts, chosen.T, strict=True)]
            for parts in (self.K, self.S, self.r)
        )
        summed = sum(S) + self.inertia, sum(r) + self.weight
        return _Whitened.of(np.concatenate(K, axis=2), *summed, self.options.nothing)


def row_by_row(count: int, arms: int) -> Indices:
    """The combinations of so many postures of each arm, one after the other, (count, arms)."""
    return np.tile(np.arange(count)[:, None], arms)


@dataclass(frozen=True, eq=False)
class _Whitened:
    """K T = RᵀV with V Vᵀ = I, and R⁻ᵀS and R⁻ᵀr, of many postures.

    In these coordinates, y = R w, neither units nor the posture make the set long in one direction.
    """

    R: Array  # (count, m, m)
    V: Array  # (count, m, N)
    S: Array  # (count, m, a)
    r: Array  # (count, m)
    sound: Mask  # where the equations of motion are not singular, (count,)

    @classmethod
    def of(cls, K: Array, S: Array, r: Array, nothing: float) -> _Whitened:
        sound = np.asarray(np.isfinite(K).all(axis=(1, 2)) & np.isfinite(S).all(axis=(1, 2)))
        sound &= np.isfinite(r).all(axis=1)
        Q, R = np.linalg.qr(np.where(sound[:, None, None], K, 0.0).swapaxes(1, 2))
        pivots = np.abs(np.diagonal(R, axis1=1, axis2=2))
        sound &= (pivots > nothing * np.linalg.norm(R, axis=1)).all(axis=1)
        R = np.where(sound[:, None, None], R, np.eye(R.shape[1]))
        both = np.concatenate([S, r[:, :, None]], axis=2)
        both = np.linalg.solve(R.swapaxes(1, 2), np.where(sound[:, None, None], both, 0.0))
        return cls(R, Q.swapaxes(1, 2), both[:, :, :-1], both[:, :, -1], sound)

    @property
    def even(self) -> Array:
        """The generators at unit length, (count, m, N)."""
        sizes = np.linalg.norm(self.V, axis=1, keepdims=True)
        return np.asarray(self.V / np.where(sizes > 0, sizes, 1.0))

    def radii(self, y: Array, nothing: float, signed: Callable[[Array], Array] = np.abs) -> Array:
        """Distances of half-spaces with normals ±y, (count, m, k), of any length: (count, k).

        The nearer of both counts, or that along y or against it if ``signed`` gives yᵀr or −yᵀr.
        """
        sizes = np.sqrt((y * y).sum(axis=1))
        room = np.abs(self.V.swapaxes(1, 2) @ y).sum(axis=1) - signed(self.r[:, None] @ y)[:, 0]
        moved = self.S.swapaxes(1, 2) @ y
        distances = _ratio(room, (moved * moved).sum(axis=1))
        return np.where(sizes > nothing, distances, np.inf)


def _ratio(room: Array, square: Array) -> Array:
    """Bounds of a radius: room over the root of a square; infinite where that is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = room / np.sqrt(square)
    return np.where(square > 0, bounds, np.copysign(np.inf, room))


def _lower(M: Array) -> Array:
    """Cholesky factors, (count, n, n), NaN where there is none."""
    try:
        return np.asarray(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        return _singly(np.linalg.cholesky, M)


def _divided(A: Array, B: Array) -> Array:
    """A⁻¹B, (count, m, k), NaN where A is singular."""
    try:
        return np.asarray(np.linalg.solve(A, B))
    except np.linalg.LinAlgError:
        return _singly(np.linalg.solve, A, B)


def _singly(function: Callable[..., Any], *matrices: Array) -> Array:
    """A function of matrices one by one, NaN where it fails."""
    results = []
    for each in zip(*matrices, strict=True):
        try:
            results.append(function(*each))
        except np.linalg.LinAlgError:
            results.append(np.full_like(each[-1], np.nan))
    return np.array(results)
