"""The exact set of accelerations under box-shaped torque limits, cut to chosen coordinates.

Enumerated here because libraries for robots' polytopes know the whole zonotope and its shadows, but
no slices.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from copose.capability.ellipsoid import _unit
from copose.errors import CoposeError
from copose.poses import Array, Indices, Mask, frozen_array
from copose.progress import heed

# Half-spaces that are enumerated at most; with more there are linear programs.
_MOST = 10**6
# Choices of generators, or half-spaces, that are worked on at once.
_CHUNK = 2**14


@dataclass(frozen=True)
class ExactSetOptions:
    """Tolerances relative to the set's own extent, and the size of a search."""

    tiny: float = 1e-12  # of ranks, and of half-spaces that meet the slice
    same: float = 1e-9  # gain in distance below which a nearest half-space is found
    starts: int = 16  # half-spaces from which the nearest is sought, too many to enumerate


@dataclass(frozen=True, eq=False)
class ExactSet:
    """{x : the acceleration with x on `axes` and zero elsewhere is B τ + c for some |τ| ≤ T}.

    A slice of the zonotope Z = {B τ + c : |τ_k| ≤ T_k}; with all coordinates as axes, Z itself.
    Lengths are in the units of the coordinates chosen.
    """

    generators: Array  # B T, (m, N), of rank m
    center: Array  # c, (m,)
    axes: tuple[int, ...]  # indices of the a coordinates of x, in the order of x
    options: ExactSetOptions = ExactSetOptions()

    @classmethod
    def of(
        cls,
        torque_map: ArrayLike,
        limits: ArrayLike,
        center: ArrayLike,
        axes: Sequence[int] | None = None,
    ) -> ExactSet:
        """The set of B, (m, N), T, (N,), and c, (m,), cut to ``axes``: None for all m.

        Raises:
            ValueError: shapes or axes do not fit, numbers are not finite, limits are not positive,
                or B has a rank below m: the set is flat.
        """
        B, T, c = (np.asarray(x, dtype=float) for x in (torque_map, limits, center))
        if B.ndim != 2 or T.shape != B.shape[1:] or c.shape != B.shape[:1]:
            raise ValueError("the exact set takes a map (m, N), limits (N,) and a centre (m,)")
        if not all(np.all(np.isfinite(x)) for x in (B, T, c)):
            raise ValueError("the exact set must be of finite numbers")
        if not np.all(T > 0):
            raise ValueError("the limits of an exact set must be positive")
        chosen = tuple(range(len(c))) if axes is None else tuple(int(i) for i in axes)
        if not chosen or len(set(chosen)) < len(chosen) or not set(chosen) <= set(range(len(c))):
            raise ValueError("the axes of an exact set must be distinct coordinates of it")
        G = B * T
        sizes = np.linalg.norm(G, axis=1)
        if min(G.shape) < len(c) or not np.all(sizes > 0):
            raise ValueError("the exact set is flat: its map lacks rank")
        values = np.linalg.svd(G / sizes[:, None], compute_uv=False)
        if values[-1] <= cls.options.tiny * values[0]:
            raise ValueError("the exact set is flat: its map lacks rank")
        return cls(frozen_array(G), frozen_array(c), chosen)

    @cached_property
    def half_spaces(self) -> tuple[Array, Array] | None:
        """H, unit rows, (k, a), and d, (k,), with slice = {x : H x ≤ d}, from every facet of Z.

        Facets thinner than 10⁻⁹ of their length are left out; those of Z that the slice does not
        meet are not. Of a slice that a half-space without x excludes, two that contradict each
        other. None where they would be more than 10⁶.
        """
        if self._facets is None:
            return None
        Y, spread = self._facets
        shift, rows = Y @ self.center, Y[:, list(self.axes)]
        # In the frame of the slice, where no direction is long or short by its units.
        meets = np.linalg.norm(rows @ self._frame, axis=1) > self.options.tiny
        if np.any(np.abs(shift[~meets]) > (1 + self.options.same) * spread[~meets]):
            H = np.zeros((2, len(self.axes)))
            H[:, 0] = 1.0, -1.0
            return frozen_array(H), frozen_array([-1.0, -1.0])
        rows, shift, spread = rows[meets], shift[meets], spread[meets]
        norms = np.tile(np.linalg.norm(rows, axis=1), 2)
        H = np.vstack([rows, -rows]) / norms[:, None]
        d = np.concatenate([spread + shift, spread - shift]) / norms
        return frozen_array(H), frozen_array(d)

    @property
    def empty(self) -> bool:
        """True where no acceleration of the slice is within the limits."""
        return self._depth[0] < 1 - self.options.same

    def support(self, direction: ArrayLike) -> float:
        """Max of uᵀx over the slice, u = direction / ‖direction‖: ‖T Bᵀu‖₁ + cᵀu for Z itself.

        Raises:
            ValueError: the slice is empty, or the direction is zero or not finite.
        """
        u = _unit(direction)
        if len(self.axes) == len(self.center):
            y = self._padded(u)
            return float(np.abs(y @ self.generators).sum() + self.center @ y)
        point = self._extreme(u)
        if point is None:
            raise ValueError("the slice is empty: it supports nothing")
        return float(u @ point)

    def reach(self, direction: ArrayLike) -> float | None:
        """Max of {α : α u ∈ slice}, u = direction / ‖direction‖: how far the line of u stays in.

        Negative where rest is outside and all of the line that is inside is behind it; None where
        the line misses the slice.

        Raises:
            ValueError: the direction is zero or not finite.
        """
        hit = self._hit(_unit(direction))
        return None if hit is None else hit[0]

    @cached_property
    def residual_radius(self) -> float:
        """Radius of the largest ball about rest, x = 0, in the slice; 0 where rest is not inside.

        The least d, never less than 0. Where half-spaces are too many to enumerate, the least that
        a search finds, which may be too large: see `_nearest`.
        """
        return self._touched[0]

    @property
    def weakest(self) -> Array | None:
        """The unit direction, (a,), in which that ball touches the surface; None where it is 0."""
        return self._touched[1] if self.residual_radius else None

    @cached_property
    def _touched(self) -> tuple[float, Array]:
        if self.half_spaces is None:
            return self._nearest()
        H, d = self.half_spaces
        k = int(d.argmin())
        return max(0.0, float(d[k])), H[k]

    @cached_property
    def vertices(self) -> Array:
        """Corners of the slice, (k, a): [low, high] if a = 1, counter-clockwise if a = 2.

        None, (0, a), of a slice that is empty or does not meet the inside of Z. Where half-spaces
        are too many to enumerate, or too near to degenerate for Qhull, points of its surface that
        are extreme in directions all around.

        Raises:
            ValueError: a > 3.
        """
        from scipy.spatial import QhullError

        a = len(self.axes)
        if a > 3:
            raise ValueError(f"vertices are for at most 3 axes, not {a}")
        depth, _ = self._depth
        flat = frozen_array(np.zeros((0, a)))
        if depth <= 1 + self.options.same:
            return flat
        if a == 1:
            return frozen_array(np.sort(self._extremes(), axis=0))
        for points_of in (self._corners, self._extremes):
            with contextlib.suppress(QhullError):
                return self._hull(points_of())
        return flat

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> Mask:
        """A mask of the points, (..., a), that are inside with limits T (1 + tolerance)."""
        x = np.asarray(points, dtype=float)
        offset = self._padded(x.reshape(-1, x.shape[-1])) - self.center
        if self._facets is None:
            within = np.array([self._holds(p, tolerance) for p in offset], dtype=bool)
            return within.reshape(x.shape[:-1])
        within = np.ones(len(offset), dtype=bool)
        Y, spread = self._facets
        step = max(1, _CHUNK * 64 // max(1, len(offset)))
        for i in range(0, len(Y), step):
            far = np.abs(offset @ Y[i : i + step].T)
            within &= np.all(far <= (1 + tolerance) * spread[i : i + step], axis=1)
        return within.reshape(x.shape[:-1])

    def _padded(self, x: Array) -> Array:
        """Accelerations, (..., m), of x, (..., a)."""
        if x.shape[-1] != len(self.axes):
            raise ValueError(f"the exact set has {len(self.axes)} axes, not {x.shape[-1]}")
        full = np.zeros((*x.shape[:-1], len(self.center)))
        full[..., list(self.axes)] = x
        return full

    @cached_property
    def _whitening(self) -> tuple[Array, Array]:
        """W, (m, m), and V = W B T, (m, N), with V Vᵀ = I.

        In these coordinates neither units nor the posture make Z long in one direction.
        """
        sizes = np.linalg.norm(self.generators, axis=1)
        U, values, _ = np.linalg.svd(self.generators / sizes[:, None], full_matrices=False)
        W = (U / values).T / sizes
        return W, W @ self.generators

    @cached_property
    def _frame(self) -> Array:
        """F, (a, a), det F > 0: the slice of the whitening's ellipsoid is {F z : ‖z‖ ≤ 1}."""
        _, R = np.linalg.qr(self._whitening[0][:, list(self.axes)])
        return np.asarray(np.linalg.inv(np.sign(np.diag(R))[:, None] * R))

    @cached_property
    def _facets(self) -> tuple[Array, Array] | None:
        """Y, (k, m), and h, (k,): Z = {a : |Y (a − c)| ≤ h}; None if 2 k would be above `_MOST`.

        A facet is parallel to m − 1 independent generators, so its normal y is perpendicular to
        them, and h = ‖T Bᵀy‖₁.

        Source: M. Gouttefarde, S. Krut, *Characterization of Parallel Manipulator Available Wrench
        Set Facets*.
        """
        W, V = self._whitening
        m, N = V.shape
        if 2 * math.comb(N, m - 1) > _MOST:
            return None
        sizes = np.linalg.norm(V, axis=0)
        choices = itertools.combinations(range(N), m - 1)
        Y, h = [], []
        while block := list(itertools.islice(choices, _CHUNK)):
            heed()
            chosen = np.array(block, dtype=np.intp)
            # The last column of Q is perpendicular to the m − 1 others, however dependent they are,
            # but of dependent ones it is any such vector: a half-space that need not be a facet's.
            Q, R = np.linalg.qr(V.T[chosen].transpose(0, 2, 1), mode="complete")
            apart = np.abs(np.diagonal(R, axis1=1, axis2=2)) > self.options.same * sizes[chosen]
            y = Q[apart.all(axis=1), :, -1]
            Y.append(y @ W)
            h.append(np.abs(y @ V).sum(axis=1))
        return frozen_array(np.concatenate(Y)), frozen_array(np.concatenate(h))

    def _maximum(
        self, steps: Array, reward: Array, start: Array, most: float = math.inf
    ) -> tuple[Array, Array] | None:
        """(z, y): rewardᵀz greatest with start + steps z in the whitened Z, and y the dual.

        yᵀsteps = reward, and {p : yᵀp ≤ ‖Vᵀy‖₁ + yᵀW c} holds Z and touches it where z ends.

        Args:
            steps: whitened, (m, k), columns of about unit length.
            reward: (k,).
            start: whitened, (m,).
            most: upper bound on the last entry of z.
        """
        from scipy.optimize import linprog

        W, V = self._whitening
        n, k = V.shape[1], steps.shape[1]
        scale = float(np.abs(reward).max())
        bounds = [(-1.0, 1.0)] * n + [(-math.inf, math.inf)] * (k - 1) + [(-math.inf, most)]
        answer = linprog(
            np.concatenate([np.zeros(n), -reward / scale]),
            A_eq=np.hstack([V, -steps]),
            b_eq=start - W @ self.center,
            bounds=bounds,
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        if answer.status == 2:
            return None
        if answer.status != 0 or answer.x is None:
            raise CoposeError(f"a linear program of the exact set failed: {answer.message}")
        return np.asarray(answer.x[n:]), np.asarray(answer.eqlin.marginals) * scale

    def _extreme(self, direction: Array) -> Array | None:
        """A point of the slice, (a,), that is farthest in a direction, (a,); None of no slice."""
        steps = self._whitening[0][:, list(self.axes)] @ self._frame
        end = self._maximum(steps, self._frame.T @ direction, np.zeros(len(steps)))
        return None if end is None else self._frame @ end[0]

    def _hit(self, u: Array) -> tuple[float, Array, float] | None:
        """(α, n, d): `reach` along u and a half-space nᵀx ≤ d, ‖n‖ = 1, that stops it there."""
        W, V = self._whitening
        step = W @ self._padded(u)
        length = float(np.linalg.norm(step))
        end = self._maximum(step[:, None] / length, np.ones(1), np.zeros(len(W)))
        if end is None:
            return None
        (alpha,), dual = end
        y = dual @ W
        n = y[list(self.axes)]
        norm = float(np.linalg.norm(n))
        d = float(np.abs(dual @ V).sum() + y @ self.center) / norm
        return float(alpha) / length, n / norm, d

    def _holds(self, offset: Array, tolerance: float) -> bool:
        """True where c + offset, (m,), is in Z with limits T (1 + tolerance)."""
        W, _ = self._whitening
        step = W @ offset
        length = float(np.linalg.norm(step))
        if length == 0 or not math.isfinite(length):
            return length == 0
        end = self._maximum(step[:, None] / length, np.ones(1), W @ self.center)
        return end is not None and float(end[0][0]) * (1 + tolerance) >= length

    @cached_property
    def _depth(self) -> tuple[float, Array]:
        """(s, x): with limits T / s the slice still has x, (a,), and s is greatest, at most 100.

        The slice is empty where s < 1 and flat, or a part of the surface of Z, where s = 1.
        """
        W, _ = self._whitening
        c = W @ self.center
        # x within T / s is s x within T about s c: both unknown, the program is linear in them.
        size = max(1.0, float(np.linalg.norm(c)))
        steps = np.column_stack([W[:, list(self.axes)] @ self._frame, -c / size])
        reward = np.zeros(len(self.axes) + 1)
        reward[-1] = 1.0
        end = self._maximum(steps, reward, c, most=100 * size)
        assert end is not None, "s = 0 is always possible"
        s = float(end[0][-1]) / size
        return s, np.asarray(self._frame @ end[0][:-1] / s)

    def _directions(self) -> Array:
        """Directions all around the slice's frame, each with its opposite, (k, a)."""
        a = len(self.axes)
        if a == 1:
            half = np.ones((1, 1))
        elif a == 2:
            angle = np.arange(32) * np.pi / 32
            half = np.column_stack([np.cos(angle), np.sin(angle)])
        elif a == 3:
            # A Fibonacci lattice of the upper half.
            z, turn = (np.arange(100) + 0.5) / 100, np.arange(100) * np.pi * (3 - math.sqrt(5))
            flat = np.sqrt(1 - z**2)
            half = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
        else:
            half = np.random.default_rng(0).normal(size=(100, a))
            half /= np.linalg.norm(half, axis=1, keepdims=True)
        return np.vstack([half, -half])

    def _nearest(self) -> tuple[float, Array]:
        """The nearest half-space that a search finds: distance, at least 0, and normal.

        The ray from rest along a half-space's normal ends on it, at its distance, or on a nearer
        one: that is the next. Each ends at one that no other hides; the nearest of all is such a
        one, but not every such one is the nearest.
        """
        hits: list[tuple[float, Array]] = []
        for u in self._directions() @ self._frame.T:
            hit = self._hit(_unit(u))
            if hit is None or hit[2] <= 0:
                return 0.0, _unit(u)
            hits.append((hit[2], hit[1]))
        distances = np.array([d for d, _ in hits])
        _, first = np.unique(np.round(distances / distances.min(), 9), return_index=True)
        ends = []
        for nearest, n in (hits[i] for i in first[: self.options.starts]):
            while (hit := self._hit(n)) and hit[2] < nearest - self.options.same * abs(nearest):
                _, n, nearest = hit
            ends.append((nearest, n))
        nearest, n = min(ends, key=lambda end: end[0])
        return max(0.0, nearest), n

    def _extremes(self) -> Array:
        """Points of the slice's surface that are extreme in directions all around it, (k, a)."""
        normals = np.linalg.solve(self._frame.T, self._directions().T).T
        points = [self._extreme(n) for n in normals]
        return np.array([p for p in points if p is not None])

    def _hull(self, points: Array) -> Array:
        """Corners of the convex hull of points, (k, a), counter-clockwise if a = 2."""
        from scipy.spatial import ConvexHull

        # In the frame of the slice, which keeps the sense of rotation and evens out its extent.
        even = np.linalg.solve(self._frame, (points - points.mean(axis=0)).T).T
        first = _distinct(even / np.abs(even).max())
        return frozen_array(points[first][ConvexHull(even[first]).vertices])

    def _corners(self) -> Array:
        """Corners where half-spaces meet, (k, a), some more than once; else `_extremes`."""
        from scipy.spatial import HalfspaceIntersection

        if self.half_spaces is None:
            return self._extremes()
        H, d = self.half_spaces
        inside = self._depth[1]
        # In the frame of the slice, about a point inside, with the nearest half-space at 1.
        rows = np.column_stack([H @ self._frame, H @ inside - d])
        rows /= np.linalg.norm(rows[:, :-1], axis=1, keepdims=True)
        nearest = -rows[:, -1].max()
        rows[:, -1] /= nearest
        # Those that differ by rounding alone would meet anywhere on their facet.
        even = HalfspaceIntersection(rows[_distinct(rows)], np.zeros(len(self.axes)))
        return np.asarray(even.intersections * nearest @ self._frame.T + inside)


def _distinct(rows: Array) -> Indices:
    """Indices of rows, (k, p), no two of them equal to nine decimals."""
    _, first = np.unique(np.round(rows, 9), axis=0, return_index=True)
    return np.asarray(first, dtype=np.intp)
