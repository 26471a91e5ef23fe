"""Whether bodies keep clear of each other between the knots of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.paths.interpolation import hermite
from copose.paths.journey import Journey
from copose.planning.clearance import configurations_of
from copose.planning.machinery import Machinery
from copose.poses import Array
from copose.progress import heed

# The part of the clearance that bodies keep between knots; where it is less there are more knots.
_NEARER = 0.9


@dataclass(frozen=True)
class Between:
    """The smallest distance between knots, m, None where none is kept; whether it is too small."""

    distance: float | None
    too_near: bool


def between_bodies(
    machinery: Machinery,
    journey: Journey,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
) -> Between:
    """Distances of the bodies themselves half way between the knots, by arm (n, n_i)."""
    bodies, cell = machinery.bodies, machinery.cell
    if bodies is None:
        return Between(None, False)
    count, least = len(q[0]), np.inf
    middle = [
        hermite(mine, rate, duration / (count - 1), 0.5)
        for mine, rate in zip(q, rates, strict=True)
    ]
    phases = (np.arange(count - 1) + 0.5) / (count - 1)
    for k, phase in enumerate(phases):
        heed()
        pose = journey.at(phase).pose
        planar = cell.problem.space.planar
        place: dict[str, object] = {"position": pose.position, "rpy": pose.rpy}
        if planar:
            place = {"position": pose.position[:2], "angle": pose.rpy[2]}
        there = cell.moved(place)
        nearest = bodies.nearest(configurations_of(there, [mine[k] for mine in middle])[0])
        if nearest is not None:
            least = min(least, nearest.distance)
    wanted = _NEARER * cell.problem.constraints.clearance
    return Between(float(least) if np.isfinite(least) else None, bool(least < wanted))
