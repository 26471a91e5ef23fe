"""Walks along self-motions with several degrees of freedom, from closed posture to posture.

{q : closure(q) = 0, lower ≤ q ≤ upper} of an arm with two or more degrees of freedom to spare is a
surface. A walk heads for a posture in the tangent space of the surface where it is and returns onto
it after each step; joints at their limits stay there. Walks that arrive tell that two postures are
connected; that none arrives tells nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project


@dataclass(frozen=True)
class WalkOptions:
    """Steps of a walk; lengths are norms of differences of joints, rad (or m)."""

    longest: float = 0.25  # step
    shortest: float = 0.015  # step: where it would be shorter the walk ends
    steps: int = 80  # at most
    projections: int = 6  # Gauss–Newton steps back onto the surface
    closed: float = 1e-2 * CLOSED  # residual that needs no further step, m or rad
    aside: float = 0.35  # displacement by the projection, over the step's length, at most
    nearer: float = 0.1  # approach to the target, over the step's length, at least
    growth: float = 1.5  # of the step after one that counts
    same: float = 1e-6  # rates and displacements that are rounding
    damping: float = 1e-12  # of J Jᵀ, of its trace, where it is singular


def walk(
    manifold: ClosureManifold, q: Array, to: Array, options: WalkOptions = WalkOptions()
) -> tuple[Mask, list[Array]]:
    """Walks from closed postures to others.

    Args:
        manifold: of the arms.
        q: where the walks start, (k, n).
        to: where they head, (k, n).
        options: of the steps.

    Returns:
        Which arrive, (k,), and the postures after every step, (k, n) each, in the end the target of
        those that arrive.
    """
    x, length = q.copy(), np.full(len(q), options.longest)
    trail, arrived = [q], np.zeros(len(q), dtype=bool)
    going = ~arrived
    for _ in range(options.steps):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        known = x[rows]
        # A start beyond limits may only come back.
        going_on = manifold.taken(rows).widened(known)
        offset = going_on.wrapped(to[rows] - known)
        distance = np.linalg.norm(offset, axis=1)
        last = distance <= length[rows]
        direction = np.where(last[:, None], offset / 2, _along(going_on, known, offset, options))
        speed = np.linalg.norm(direction, axis=1)
        far = np.where(last, speed, np.minimum(length[rows], speed))
        scale = np.divide(far, speed, out=np.zeros_like(far), where=speed > 0)
        guess = known + scale[:, None] * direction
        ends, gaps = project(
            going_on.kernels,
            guess,
            going_on.goals,
            going_on.lower,
            going_on.upper,
            steps=options.projections,
            closed=options.closed,
        )
        left = np.linalg.norm(going_on.wrapped(to[rows] - ends), axis=1)
        aside = np.linalg.norm(ends - guess, axis=1)
        good = (gaps <= CLOSED) & (aside <= options.aside * far + options.same)
        # The last step is to a posture half way, which must be where it seems to be.
        good &= last | (left < distance - options.nearer * far)
        done = good & last
        ends[done] = known[done] + offset[done]
        arrived[rows[done]] = True
        going[rows[done]] = False
        x[rows[good]] = ends[good]
        length[rows[~good]] = np.minimum(length[rows[~good]], far[~good]) / 2
        length[rows[good]] = np.minimum(options.growth * length[rows[good]], options.longest)
        going[rows[(length[rows] < options.shortest) & ~done]] = False
        trail.append(x.copy())
    return arrived, trail


def _along(manifold: ClosureManifold, q: Array, offset: Array, options: WalkOptions) -> Array:
    """Parts of differences, (k, n), in the tangent spaces, that push no joint through a limit."""
    same = options.same
    _, J = manifold.kernels.residual(q, manifold.goals)
    direction = offset
    free = np.ones_like(q)
    for _ in range(q.shape[1]):
        direction = offset * free
        open_ = J * free[:, None]
        square = open_ @ open_.swapaxes(1, 2)
        size = np.trace(square, axis1=1, axis2=2)[:, None, None]
        square += (options.damping * size + 1e-100) * np.eye(square.shape[1])
        force = np.linalg.solve(square, open_ @ direction[:, :, None])
        direction = direction - (open_.swapaxes(1, 2) @ force)[:, :, 0]
        pushed = (q <= manifold.lower) & (direction < -same)
        pushed |= (q >= manifold.upper) & (direction > same)
        if not pushed.any():
            break
        free[pushed] = 0.0
    return np.asarray(direction * free)


def connected(
    manifold: ClosureManifold, nodes: Array, only: int | None = None, attempts: int = 3
) -> Mask:
    """Closed postures of one arm that walks connect with the first, as a mask, (count,).

    Args:
        manifold: of the arm, (1, n).
        nodes: the postures, (count, n).
        only: one whose connection ends the search.
        attempts: postures towards which, or from which, each posture walks.
    """
    count = len(nodes)
    reached = np.zeros(count, dtype=bool)
    reached[0] = True
    distances = np.linalg.norm(
        manifold.wrapped((nodes[:, None] - nodes[None]).reshape(count * count, -1)), axis=1
    ).reshape(count, count)
    tried = np.eye(count, dtype=bool)
    tries = np.zeros(count, dtype=int)
    while True:
        new = np.flatnonzero(~reached & (tries < attempts))
        if not len(new) or (only is not None and reached[only]):
            return reached
        apart = np.where(reached & ~tried[new], distances[new], np.inf)
        nearest = apart.argmin(axis=1)
        untried = np.isfinite(apart[np.arange(len(new)), nearest])
        new, nearest = new[untried], nearest[untried]
        if not len(new):
            return reached
        tried[new, nearest] = True
        tries[new] += 1
        many = manifold.many(len(new))
        arrived, _ = walk(many, nodes[new], nodes[nearest])
        back = np.flatnonzero(~arrived)
        if len(back):
            arrived[back] = walk(many.taken(back), nodes[nearest[back]], nodes[new[back]])[0]
        reached[new[arrived]] = True
