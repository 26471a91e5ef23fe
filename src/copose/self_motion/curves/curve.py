"""A traced self-motion with one degree of freedom, and the options of tracing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.manifold import ClosureManifold


@dataclass(frozen=True)
class TracingOptions:
    """Step lengths and tolerances of tracing; lengths in the space of joints, rad (or m)."""

    longest: float = 0.2  # step, and so the distance of points
    first: float = 0.5  # step, over the longest
    shortest: float = 1e-4  # step: where it would be shorter the trace ends
    growth: float = 1.6  # of the step where the curve is very straight
    steps: int = 3000  # at most
    closed: float = 1e-10  # residual on the curve
    closed_well: float = 1e-11  # residual of points that are told apart from others
    straight: float = 0.9  # least cosine between the tangents at both ends of a step
    very_straight: float = 0.985  # cosine from which the next step may be longer
    aside: float = 0.4  # distance of a step's end from the tangent, over its length, at most
    same: float = 1e-5  # difference of joints that are the same
    # Difference of the tangents of two fronts from those of an arc between them, up to which they
    # meet without a step.
    arc: float = 0.0
    oblique: float = 1.5  # distance of a posture that a step may pass, over that along it, at most
    touching: float = 1e-9  # joint beyond a limit that counts as at it
    unsure: float = 0.5  # error of the estimated depth of a joint's turn, as a part of it
    shallow: float = 1e-8  # depth of a turn that does not matter
    halvings: int = 40  # that find the posture at a limit
    room: float = 0.6  # of the way to where det [J; tᵀ] would vanish, as it falls
    singular: float = 1e-11  # det [J; tᵀ] over |J|ᵐ below which there is no one tangent


@dataclass(frozen=True, eq=False)
class Curve:
    """A traced self-motion with one degree of freedom: points in order, with tangents."""

    points: Array  # along it in order, the posture among them, (count, n)
    tangents: Array  # there, (count, n)
    loop: bool  # whether the last is followed by the first
    complete: bool  # whether both ends are at limits, or it is a loop
    stops: tuple[int, ...]  # numbers of the joints whose limits end it
    manifold: ClosureManifold  # of the arm, (1, n)
    options: TracingOptions = TracingOptions()  # by which it was traced

    @cached_property
    def lengths(self) -> Array:
        """Distances along the tangent from each point to the next, (count,); zero at an end."""
        ahead = np.roll(self.points, -1, axis=0) - self.points
        along = (self.manifold.many(len(ahead)).wrapped(ahead) * self.tangents).sum(axis=1)
        return along if self.loop else np.append(along[:-1], 0.0)

    def at(self, rows: Indices, along: Array) -> tuple[Array, Mask]:
        """Postures at some distances after points, (count, n), and which are on the curve."""
        base, tangent = self.points[rows], self.tangents[rows]
        step = self.manifold.many(len(rows)).step(
            base, tangent, along, np.zeros_like(base), self.options.closed_well
        )
        return step.q, step.closed

    def place(self, q: Array) -> tuple[int, float] | None:
        """The point before a closed posture, (n,), and its distance; None where it is elsewhere."""
        same, aside = self.options.same, self.options.aside
        offset = self.manifold.many(len(self.points)).wrapped(q - self.points)
        along = (offset * self.tangents).sum(axis=1)
        near = (along >= -same) & (along <= self.lengths + same)
        near &= (offset**2).sum(axis=1) - along**2 <= (aside * self.lengths + same) ** 2
        rows = np.flatnonzero(near)
        if not len(rows):
            return None
        x, closed = self.at(rows, along[rows])
        apart = np.abs(x - self.points[rows] - offset[rows]).max(axis=1)
        apart[~closed] = np.inf
        k = int(apart.argmin())
        return (int(rows[k]), float(along[rows[k]])) if apart[k] < same else None
