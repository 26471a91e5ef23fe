"""Proof that bodies keep their clearance between the knots of a motion, at every time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.motion.curve.cubic_motion import CubicMotion
from copose.motion.path.object_motion import ObjectMotion
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.progress import heed


@dataclass(frozen=True)
class ProofOptions:
    """Options of the proof of clearance between knots."""

    missing: float = 1e-6  # of the clearance, m, that is tolerated, as at the knots
    proved: float = 0.9  # part of the least distance at knots that is tried to be proved first
    halvings: int = 12  # of an interval before the proof is given up
    halvings_after_failure: int = 5  # the same once bodies came too near elsewhere


@dataclass(frozen=True)
class Between:
    """The clearance of bodies between knots.

    Attributes:
        distance: what they keep at every time, m; None where none is tested. Where that is not
            proved, the least that was met.
        missing: how much that is less than the clearance, m.
    """

    distance: float | None
    missing: float


def between_bodies(
    model: PostureModel,
    journey: ObjectMotion,
    q: Sequence[Array],
    rates: Sequence[Array],
    duration: float,
    options: ProofOptions = ProofOptions(),
) -> Between:
    """The distance that bodies keep at every time between knots, by conservative advancement.

    In a time h the distance of two bodies changes by L h at most, L the largest speed of a point of
    one as the other sees it, so that it is (d + d' − L h)/2 or more between two instants. How far
    hulls are apart along a direction, min(g, g') − A h²/8 or more with A the largest acceleration,
    bounds their distance. Where both are too little the time between the instants is halved.

    Args:
        model: what knows the bodies.
        journey: the object's.
        q: joints at the knots, by arm (n, n_i).
        rates: alike.
        duration: s.
        options: of the proof.
    """
    bodies = model.bodies
    if bodies is None or not len(bodies.pairs):
        return Between(None, 0.0)
    motion = CubicMotion(
        model, journey, np.hstack(q), np.hstack(rates), duration, 2**options.halvings
    )
    goal, least = bodies.clearance - options.missing, motion.least_at_knots()
    generous = options.proved * least
    if generous > goal and _least(motion, generous, options, roughly=True) is None:
        return Between(generous, 0.0)
    met = _least(motion, goal, options)
    if met is None:
        return Between(goal, 0.0)
    return Between(met, bodies.clearance - met)


def _least(
    motion: CubicMotion, goal: float, options: ProofOptions, *, roughly: bool = False
) -> float | None:
    """The least distance met, m; None where bodies are proved to be farther apart than a goal.

    Args:
        motion: instant by instant.
        goal: m.
        options: of the proof.
        roughly: whether any distance below the goal will do.
    """
    met = np.inf
    begin, parts = (grid.ravel() for grid in np.indices((len(motion), len(motion.pairs))))
    begin, span = begin * motion.instants, motion.instants
    for level in range(options.halvings + 1):
        heed()
        h = motion.step * span / motion.instants
        speeds, bends = motion.rates(begin, span, parts)
        drop, sag = speeds * h, bends * h**2 / 8
        ends = motion.rows(begin), motion.rows(begin + span)
        spheres = motion.balls(ends[0], parts) + motion.balls(ends[1], parts)
        left = (spheres - drop) / 2 < min(goal, met)
        begin, parts, drop, sag = begin[left], parts[left], drop[left], sag[left]
        ends = ends[0][left], ends[1][left]
        (one, n), (other, m) = (motion.hulls(rows, parts) for rows in ends)
        sure = (one + other - drop) / 2
        left = sure < min(goal, met)
        for first, second, normals in ((*ends, n), (*ends[::-1], m)):
            spans = motion.spans(first[left], second[left], parts[left], normals[left])
            sure[left] = np.maximum(sure[left], spans - sag[left])
            left = sure < min(goal, met)
        close = np.flatnonzero(left & (np.minimum(one, other) < goal))
        if len(close):
            one, other = (motion.distances(rows[close], parts[close]) for rows in ends)
            met = min(met, one.min(), other.min())
            sure[close] = np.maximum(sure[close], (one + other - drop[close]) / 2)
        left = sure < min(goal, met)
        begin, parts, sure = begin[left], parts[left], sure[left]
        if not len(parts) or (met < goal and (roughly or level >= options.halvings_after_failure)):
            break
        span //= 2
        begin, parts = np.concatenate([begin, begin + span]), np.tile(parts, 2)
    else:
        met = min(met, sure.min())
    return None if met >= goal else met
