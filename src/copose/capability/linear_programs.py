"""Many small linear programs at once.

An interior-point method in batches, because a library's solver takes two milliseconds to start on a
program that is solved in a tenth of one. What is reported comes from the library.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.progress import heed


@dataclass(frozen=True)
class InteriorPointOptions:
    """Steps and tolerances of the interior-point method."""

    iterations: int = 40  # at most
    back: float = 0.995  # of the way to a bound that a step goes
    good: float = 1e-8  # error from which on rounding may be all that is left
    poor: float = 1e-6  # error beyond which it cannot be told whether there is an optimum: the
    none: float = 1e-3  # library is asked; and beyond which there is none
    dependent: float = 1e-9  # of a column's length, that is independent of the others to count
    nothing: float = 1e-4  # of that, which rows say of x_0 where it has no end
    largest: float = 1e10  # iterates beyond have no end, or nothing is feasible


def maximise_first(
    A: Array,
    b: Array,
    within: float = 1e-10,
    options: InteriorPointOptions = InteriorPointOptions(),
) -> tuple[Array, Array]:
    """Maximise x_0 subject to A x ≤ b, for many (A, b).

    Mehrotra's predictor and corrector (S. Mehrotra, 1992).

    Args:
        A: (count, rows, p), of full column rank.
        b: (count, rows).
        within: what may be left of the optimality conditions, relative.
        options: of the method.

    Returns:
        x, (count, p), NaN where there is no optimum, and what is left of the optimality
        conditions, (count,); zero where the library was asked.
    """
    count, _, p = A.shape
    given, to_x = A, _evened(A, options.dependent)
    A = given @ to_x
    goal = np.zeros((count, p))
    goal[:, -1] = 1.0
    x = np.zeros((count, p))
    s = np.maximum(b, 1.0)
    z = np.ones_like(s)
    best, left = np.full_like(x, np.nan), np.full(count, np.inf)
    going = np.flatnonzero(np.linalg.norm(A[:, :, -1], axis=1) > options.nothing)
    for _ in range(options.iterations):
        heed()
        a, iterate = A[going], (x[going], s[going], z[going])
        x_, s_, z_ = iterate
        primal = b[going] - (a @ x_[:, :, None])[:, :, 0] - s_
        dual = goal[going] - (z_[:, None] @ a)[:, 0]
        gap = (s_ * z_).mean(axis=1)
        size = 1 + np.abs(x_[:, -1])
        error = np.maximum(np.abs(primal).max(axis=1) / size, np.abs(dual).max(axis=1))
        error = np.maximum(error, gap * s_.shape[1] / size)
        better = error < left[going]
        best[going[better]], left[going[better]] = x_[better], error[better]
        wild = ~(np.maximum(np.abs(x_).max(axis=1), z_.max(axis=1)) < options.largest)
        on = (error > within) & ~wild & (better | (left[going] > options.good))
        if not on.any():
            break
        going, a, primal, dual, gap = going[on], a[on], primal[on], dual[on], gap[on]
        x_, s_, z_ = x_[on], s_[on], z_[on]
        weights = z_ / s_
        normal = (a * weights[:, :, None]).swapaxes(1, 2) @ a
        normal += 1e-14 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(p)
        inverse = _inverse(normal)
        newton = _Newton(a, s_, z_, primal, dual, inverse)
        dx, ds, dz = newton.step(-s_ * z_)
        forward, upward = _room(s_, ds, options.back), _room(z_, dz, options.back)
        alone = ((s_ + forward[:, None] * ds) * (z_ + upward[:, None] * dz)).mean(axis=1)
        center = gap * np.minimum(alone / gap, 1.0) ** 3
        dx, ds, dz = newton.step(center[:, None] - s_ * z_ - ds * dz)
        forward, upward = _room(s_, ds, options.back), _room(z_, dz, options.back)
        forward, upward = options.back * forward, options.back * upward
        x[going] = x_ + forward[:, None] * dx
        s[going] = s_ + forward[:, None] * ds
        z[going] = z_ + upward[:, None] * dz
    poor = max(options.poor, within)
    best[left > poor] = np.nan
    for k in np.flatnonzero((left > poor) & (left <= options.none)):
        best[k], left[k] = _by_library(A[k], b[k])
    return (to_x @ best[:, :, None])[:, :, 0], left


def _evened(A: Array, dependent: float) -> Array:
    """X with x = X z, (count, p, p), such that the columns of A X are orthonormal and x_0 is in
    proportion to z's last entry.

    Rows of very different sizes leave a region that is thin in x, and round in z.
    """
    scale = 1 / np.maximum(np.sqrt((A * A).sum(axis=1)), 1e-300)[:, ::-1]
    p = A.shape[2]
    # What hardly differs from what goes before must not become large.
    rest = np.broadcast_to(dependent * np.eye(p), (len(A), p, p))
    R = np.linalg.qr(np.concatenate([A[:, :, ::-1] * scale[:, None], rest], axis=1), mode="r")
    R *= np.sign(np.diagonal(R, axis1=1, axis2=2))[:, :, None]
    return np.asarray((scale[:, :, None] * np.linalg.inv(R))[:, ::-1])


def _by_library(A: Array, b: Array) -> tuple[Array, float]:
    """The last variable at its greatest, by HiGHS."""
    from scipy.optimize import linprog

    cost = np.zeros(A.shape[1])
    cost[-1] = -1.0
    answer = linprog(cost, A, b, bounds=(None, None))
    if answer.status != 0 or answer.x is None:
        return np.full(len(cost), np.nan), np.inf
    return np.asarray(answer.x), 0.0


@dataclass(frozen=True, eq=False)
class _Newton:
    """The linearised conditions A dx + ds = primal, Aᵀdz = dual, z ds + s dz = what is asked."""

    A: Array
    s: Array
    z: Array
    primal: Array
    dual: Array
    inverse: Array

    def step(self, complementary: Array) -> tuple[Array, Array, Array]:
        """(dx, ds, dz) for s z to change so."""
        part = (complementary - self.z * self.primal) / self.s
        right = self.dual - (part[:, None] @ self.A)[:, 0]
        dx = (self.inverse @ right[:, :, None])[:, :, 0]
        ds = self.primal - (self.A @ dx[:, :, None])[:, :, 0]
        return dx, ds, (complementary - self.z * ds) / self.s


def _room(values: Array, steps: Array, back: float) -> Array:
    """The part of the steps that keeps positive values positive, at most 1/back, (count,)."""
    part = np.full_like(values, 1 / back)
    np.divide(-values, steps, out=part, where=np.asarray(steps < 0))
    return np.asarray(np.minimum(np.min(part, axis=1), 1 / back))


def _inverse(matrices: Array) -> Array:
    sound = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    matrices = np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1]))
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrices))
