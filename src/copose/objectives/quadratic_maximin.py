"""The largest minimum of a few quadratic functions in a cube, for many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array


@dataclass(frozen=True)
class MaximinOptions:
    """Steps of the interior-point method."""

    iterations: int = 18  # of which each brings the gap down by
    center: float = 0.2  # this factor, at best
    back: float = 0.99  # of the way to a bound that a step goes
    far: float = 1e3  # slack of functions that do not count, over the size of the others
    flattest: float = 1e-12  # curvature that counts as any, over the same
    least: float = 1e-14  # of slacks and multipliers, over the same


@dataclass(frozen=True, eq=False)
class Quadratics:
    """Functions value + slope·x + xᵀ bend x/2 of x, (d,), k for each of many."""

    value: Array  # (count, k), infinite of what does not count
    slope: Array  # (count, d, k)
    bend: Array  # (count, d, d, k)

    def joined(self, others: Quadratics) -> Quadratics:
        """These and others."""
        parts = ((self.value, others.value), (self.slope, others.slope), (self.bend, others.bend))
        return Quadratics(*(np.concatenate(each, axis=-1) for each in parts))

    def values(self, x: Array) -> Array:
        """Values at a point of each, (count, d): (count, k)."""
        bent = (self.bend * x[:, None, :, None]).sum(axis=2) / 2
        return np.asarray(self.value + (x[:, None] @ (self.slope + bent))[:, 0])

    def slopes(self, x: Array) -> Array:
        """Derivatives at a point of each, (count, d): (count, d, k)."""
        return np.asarray(self.slope + (self.bend * x[:, None, :, None]).sum(axis=2))

    def scaled(self, region: Array, far: float) -> tuple[Quadratics, Array]:
        """The same of x over the region, (count,), less the least at zero and over their size."""
        width = region[:, None, None]
        counts = np.isfinite(self.value) & (self.value < np.inf)
        slope = np.where(counts[:, None], self.slope * width, 0.0)
        bend = np.where(counts[:, None, None], self.bend * width[:, None] ** 2, 0.0)
        steep = np.abs(slope).sum(axis=1)
        size = steep.sum(axis=1, keepdims=True) / np.maximum(1, counts.sum(axis=1, keepdims=True))
        size = np.where(size > 0, size, 1.0)
        least = np.where(counts, self.value, np.inf).min(axis=1, keepdims=True)
        value = np.full_like(self.value, far)
        np.divide(self.value - least, size, out=value, where=counts)
        scaled = Quadratics(
            np.minimum(value, far), slope / size[:, None], bend / size[:, None, None]
        )
        return scaled, size[:, 0]


def maximin(
    functions: Quadratics, region: Array, options: MaximinOptions = MaximinOptions()
) -> tuple[Array, Array]:
    """Where the least of the functions is largest near zero in a cube, half as wide as ``region``.

    A primal-dual interior-point method with every curvature of the Lagrangian taken downwards; the
    best of its iterates.

    Returns:
        The point, (count, d), and the least of the functions there over that at zero, (count,).
    """
    scaled, size = functions.scaled(region, options.far)
    count, d, k = scaled.slope.shape
    # The sides of the cube are functions too, but not among those whose least is looked for.
    cube = np.concatenate([np.eye(d), -np.eye(d)], axis=1)
    counted = np.concatenate([np.ones(k), np.zeros(2 * d)])
    x, t = np.zeros((count, d)), np.full(count, -1.0)
    s = np.concatenate([scaled.value + 1.0, np.ones((count, 2 * d))], axis=1)
    z = 1 / s
    z /= (z * counted).sum(axis=1, keepdims=True)
    best, highest = np.zeros((count, d)), np.zeros(count)
    for _ in range(options.iterations):
        G = np.concatenate([scaled.slopes(x), np.broadcast_to(-cube, (count, d, 2 * d))], axis=2)
        values = np.concatenate([scaled.values(x), 1 - x @ cube], axis=1)
        primal = values - counted * t[:, None] - s
        gap = (s * z).mean(axis=1, keepdims=True)
        weight = z / s
        moved = (options.center * gap - s * z - z * primal) / s
        curvature = -(scaled.bend @ z[:, None, :k, None])[..., 0]
        matrix = np.zeros((count, d + 1, d + 1))
        matrix[:, :d, :d] = _upward(curvature, options.flattest)
        matrix[:, :d, :d] += (G * weight[:, None]) @ G.swapaxes(1, 2)
        matrix[:, :d, d] = matrix[:, d, :d] = -(G @ (weight * counted)[:, :, None])[:, :, 0]
        matrix[:, d, d] = (weight * counted).sum(axis=1)
        right = np.empty((count, d + 1))
        right[:, :d] = (G @ (z + moved)[:, :, None])[:, :, 0]
        right[:, d] = 1 - ((z + moved) * counted).sum(axis=1)
        step = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
        dx, dt = step[:, :d], step[:, d]
        ds = (dx[:, None] @ G)[:, 0] - counted * dt[:, None] + primal
        dz = moved - weight * (ds - primal)
        forward, upward = _room(s, ds, options.back), _room(z, dz, options.back)
        x = x + forward[:, None] * dx
        t = t + forward * dt
        s = np.maximum(s + forward[:, None] * ds, options.least)
        z = np.maximum(z + upward[:, None] * dz, options.least)
        x = np.clip(x, -1.0, 1.0)
        reached = scaled.values(x).min(axis=1)
        better = reached > highest
        best, highest = np.where(better[:, None], x, best), np.where(better, reached, highest)
    return best * region[:, None], highest * size


def _upward(curvature: Array, flattest: float) -> Array:
    """Symmetric matrices, (count, d, d), with every eigenvalue taken positive."""
    values, axes = np.linalg.eigh(curvature)
    values = np.maximum(np.abs(values), flattest)
    return np.asarray((axes * values[:, None]) @ axes.swapaxes(1, 2))


def _room(values: Array, steps: Array, back: float) -> Array:
    """The part of steps, at most 1, that keeps positive values positive, (count,)."""
    part = np.full_like(values, np.inf)
    np.divide(-values, steps, out=part, where=np.asarray(steps < 0))
    return np.asarray(np.minimum(1.0, back * part.min(axis=1)))
