"""The largest minimum of a few quadratic functions in a box, for many at once.

Newton steps on a smooth stand-in that sharpens: −log Σ exp(−β m_k)/β of the functions m_k, with
logarithmic barriers over β at the sides of the box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array


@dataclass(frozen=True)
class MaximinOptions:
    """Sharpening and steps."""

    blunt: float = 8.0  # first β, over the range of the functions in the box
    sharper: float = 4.0  # times β, from one to the next
    sharpenings: int = 16  # of β
    steps: int = 2  # Newton steps for each
    lengths: tuple[float, ...] = (0.0, 0.01, 0.05, 0.2, 0.5, 1.0)  # of a step, the best is taken
    inside: float = 0.05  # of the box, from its sides, where the first step starts
    back: float = 0.95  # of the way to a side that a step goes
    flattest: float = 1e-12  # curvature over the largest that counts as any


@dataclass(frozen=True, eq=False)
class Quadratics:
    """Functions value + slope·x + xᵀ bend x/2 of x, (count, d), k for each."""

    value: Array  # (count, k), infinite of what does not count
    slope: Array  # (count, d, k)
    bend: Array  # (count, d, d, k)

    def values(self, x: Array) -> Array:
        """Values at points, (count, p, d): (count, p, k)."""
        square = x[:, :, :, None] * x[:, :, None, :] / 2
        count, p, d = x.shape
        bent = square.reshape(count, p, d * d) @ self.bend.reshape(count, d * d, -1)
        return np.asarray(self.value[:, None] + x @ self.slope + bent)

    def slopes(self, x: Array) -> Array:
        """Derivatives at a point of each, (count, d): (count, d, k)."""
        return np.asarray(self.slope + (self.bend * x[:, None, :, None]).sum(axis=2))


def maximin(
    functions: Quadratics, low: Array, high: Array, options: MaximinOptions = MaximinOptions()
) -> tuple[Array, Array]:
    """Where the least of the functions is largest near zero within a box, (count, d), and that."""
    width = np.maximum(high - low, 1e-300)
    x = np.clip(0.0, low + options.inside * width, high - options.inside * width)
    span = (np.abs(functions.slopes(x)) * width[:, :, None]).sum(axis=1).max(axis=1)
    beta = options.blunt / np.maximum(span, 1e-300)
    lengths = np.array(options.lengths)
    rows = np.arange(len(x))
    for _ in range(options.sharpenings):
        stand_in = _StandIn(functions, low, high, beta)
        for _ in range(options.steps):
            step = stand_in.step(x, options.flattest)
            room = np.where(step > 0, high - x, x - low) * options.back
            size = np.abs(step)
            part = np.divide(room, size, out=np.ones_like(room), where=size > room).min(axis=1)
            tried = x[:, None] + lengths[:, None] * (part[:, None] * step)[:, None]
            x = tried[rows, stand_in.values(tried).argmax(axis=1)]
        beta = beta * options.sharper
    return x, functions.values(x[:, None])[:, 0].min(axis=1)


@dataclass(frozen=True, eq=False)
class _StandIn:
    functions: Quadratics
    low: Array
    high: Array
    beta: Array  # (count,)

    def values(self, x: Array) -> Array:
        """Values at points, (count, p, d): (count, p)."""
        m = self.functions.values(x)
        least = m.min(axis=2)
        beta = self.beta[:, None]
        soft = np.log(np.exp(-beta[:, :, None] * (m - least[:, :, None])).sum(axis=2))
        sides = (x - self.low[:, None]) * (self.high[:, None] - x)
        return np.asarray(least + (np.log(sides).sum(axis=2) - soft) / beta)

    def step(self, x: Array, flattest: float) -> Array:
        """The Newton step at a point of each, (count, d), with every curvature taken downwards."""
        m, beta = self.functions.values(x[:, None])[:, 0], self.beta[:, None]
        share = np.exp(-beta * (m - m.min(axis=1, keepdims=True)))
        share /= share.sum(axis=1, keepdims=True)
        slopes = self.functions.slopes(x)
        mean = (slopes @ share[:, :, None])[:, :, 0]
        apart = slopes - mean[:, :, None]
        bend = (self.functions.bend @ share[:, None, :, None])[:, :, :, 0]
        bend -= beta[:, :, None] * ((apart * share[:, None]) @ apart.swapaxes(1, 2))
        below, above = 1 / (x - self.low), 1 / (self.high - x)
        slope = mean + (below - above) / beta
        sides = (below**2 + above**2) / beta
        curvature, axes = np.linalg.eigh(bend - sides[:, :, None] * np.eye(x.shape[1]))
        size = np.abs(curvature)
        size = np.maximum(size, flattest * size.max(axis=1, keepdims=True))
        along = (axes.swapaxes(1, 2) @ slope[:, :, None])[:, :, 0] / size
        return np.asarray((axes @ along[:, :, None])[:, :, 0])
