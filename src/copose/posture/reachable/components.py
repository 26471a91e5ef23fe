"""Connected components of the closed postures of one arm, joint limits kept.

An arm that holds an object at rest moves on {q : closure(q) = 0, lower ≤ q ≤ upper}. With one
degree of freedom to spare a component is a curve, and what is said of it is definite; with more it
is explored by walks. Joint positions are what they are: only a joint without limits is the same
after a turn. Where a start is in the ``joint_margin`` the arm may only leave the margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.self_motion.curves.curve import Curve, TracingOptions
from copose.self_motion.curves.tracing import follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.walks import connected, walk


@dataclass(frozen=True, eq=False)
class Component:
    """The connected component of an arm's closed postures that its start is in, as far as known.

    Attributes:
        postures: within limits and margins, the start first, (count, n).
        start: where the arm is, (n,).
        manifold: its closure and limits.
        curve: with one degree of freedom to spare.
        complete: whether the component has no other postures.
    """

    postures: Array
    start: Array
    manifold: ClosureManifold
    curve: Curve | None
    complete: bool

    def holds(self, q: Array) -> bool | None:
        """True if a closed posture, (n,), belongs to it; None where that cannot be said."""
        manifold = self.manifold
        if same_posture(manifold, q, self.start):
            return True
        if self.curve is not None:
            return True if self.curve.place(q) is not None else known_if(self.complete)
        if self.complete or manifold.spare <= 0 or len(self.postures) == 0:
            return known_if(self.complete)
        apart = np.linalg.norm(manifold.many(len(self.postures)).wrapped(self.postures - q), axis=1)
        walked_from = 4  # nearest postures of the component
        near = self.postures[np.argsort(apart, kind="stable")[:walked_from]]
        many = manifold.many(len(near))
        to = np.tile(q, (len(near), 1))
        return bool(walk(many, near, to)[0].any() or walk(many, to, near)[0].any()) or None


def manifold_of(model: PostureModel, setting: Setting, arms: Sequence[int]) -> ClosureManifold:
    """Closure and limits of arms of one model."""
    cell = setting.cell
    return ClosureManifold(
        kernels=model.arms[arms[0]],
        goals=np.array([setting.placement.goals[i] for i in arms]),
        lower=np.array([cell.lower[i] for i in arms]),
        upper=np.array([cell.upper[i] for i in arms]),
        unlimited=np.array([_unlimited(cell, i) for i in arms]),
    )


def component(
    model: PostureModel,
    setting: Setting,
    i: int,
    start: Array,
    sample: Array | None = None,
    spacing: float = TracingOptions.longest,
) -> Component:
    """The component that a closed posture of arm i, (n,), is in.

    With several degrees of freedom to spare it is those of a sample of closed postures, (count, n),
    that walks connect with it; on a curve they are ``spacing`` apart at most, rad (or m).
    """
    cell, manifold = setting.cell, manifold_of(model, setting, [i])
    curve, points = None, start[None]
    fixed, complete = cell.arms[i].fixed, True
    if not fixed and manifold.spare == 1:
        curve = follow(manifold, start[None], options=TracingOptions(longest=spacing))[0]
        points, complete = np.vstack([points, curve.points]), curve.complete
    elif not fixed and manifold.spare > 1:
        sampled = points[:0] if sample is None else sample
        nodes = np.vstack([points, sampled])
        points, complete = nodes[connected(manifold, nodes)], False
    elif not fixed:
        complete = isolated(manifold, start)
    lower, upper = cell.lower[i], cell.upper[i]
    slack = np.maximum(np.maximum(lower - points, points - upper), 0.0).max(axis=1)
    points = points[slack <= CLOSED]
    # The start itself comes first, as it is; repetitions of it are left out.
    again = same_postures(manifold, points, start)
    points, first = points[~again], points[again][:1]
    ends, gaps = project(
        manifold.kernels, points, manifold.goals[0], lower, upper, steps=9, closed=1e-13
    )
    return Component(np.vstack([first, ends[gaps <= CLOSED]]), start, manifold, curve, complete)


def _unlimited(cell: Cell, i: int) -> Array:
    """Mask of the joints of arm i without limits, (n,)."""
    names = cell.unlimited(i)
    return np.array([joint.name in names for joint in cell.arms[i].joints], dtype=bool)


def known_if(complete: bool) -> bool | None:
    """False where everything is known, so that what was not found does not exist; else None."""
    return False if complete else None


def isolated(manifold: ClosureManifold, q: Array, singular: float = 1e-7) -> bool:
    """True if an arm with no degree of freedom to spare cannot move at a posture, (n,).

    ``singular`` is the ratio of the closure derivative's singular values that counts as zero.
    """
    _, J = manifold.kernels.residual(q[None], manifold.goals)
    size = np.linalg.svd(J[0], compute_uv=False)
    return bool(len(size) == manifold.kernels.n and size[-1] > singular * size[0])


def same_postures(manifold: ClosureManifold, q: Array, start: Array) -> Mask:
    """Mask of postures of one arm, (count, n), that are another, (n,), whole turns apart."""
    tolerance = 1e-6  # of a joint, rad or m
    return np.asarray(np.abs(manifold.many(len(q)).wrapped(q - start)).max(axis=1) <= tolerance)


def same_posture(manifold: ClosureManifold, q: Array, start: Array) -> bool:
    """True if two postures of one arm, (n,), are the same, whole turns apart."""
    return bool(same_postures(manifold, q[None], start)[0])
