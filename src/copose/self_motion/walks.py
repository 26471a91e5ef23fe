"""Self-motions with several degrees of freedom, explored by walks from posture to posture.

{q : closure(q) = 0, lower ≤ q ≤ upper} of an arm with two or more degrees of freedom to spare is a
surface. A walk heads for a posture in the tangent space of the surface where it is and returns onto
it after each step; joints at their limits stay there. Walks that arrive tell that two postures are
connected; that none arrives tells nothing.
"""

from __future__ import annotations

import numpy as np

from copose.poses import Array, Mask
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project

_STEP, _SHORTEST, _MOST = 0.25, 0.015, 80
# Of a step: what returning onto the surface may move it by, and how much nearer it must come.
_ASIDE, _NEARER = 0.35, 0.1
_SAME = 1e-6
_DAMPING = 1e-12
# Postures of a graph beside the two that count, and towards how many others each of them walks.
_TRIES = 3


def walk(rails: ClosureManifold, q: Array, to: Array) -> tuple[Mask, list[Array]]:
    """Walks from closed postures to others, (k, n).

    Returns:
        Which arrive, (k,), and where they were after every step, (k, n) each, the last at the other
        posture where they did.
    """
    x, length = q.copy(), np.full(len(q), _STEP)
    trail, arrived = [q], np.zeros(len(q), dtype=bool)
    going = ~arrived
    for _ in range(_MOST):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        mine, here = rails.taken(rows), x[rows]
        # What a start has of a margin it may only leave.
        mine.lower[:], mine.upper[:] = np.minimum(mine.lower, here), np.maximum(mine.upper, here)
        offset = mine.wrapped(to[rows] - here)
        distance = np.linalg.norm(offset, axis=1)
        last = distance <= length[rows]
        direction = np.where(last[:, None], offset / 2, _along(mine, here, offset))
        speed = np.linalg.norm(direction, axis=1)
        far = np.where(last, speed, np.minimum(length[rows], speed))
        scale = np.divide(far, speed, out=np.zeros_like(far), where=speed > 0)
        guess = here + scale[:, None] * direction
        ends, gaps = project(
            mine.kernels, guess, mine.goals, mine.lower, mine.upper, steps=6, closed=CLOSED * 1e-2
        )
        left = np.linalg.norm(mine.wrapped(to[rows] - ends), axis=1)
        good = (gaps <= CLOSED) & (np.linalg.norm(ends - guess, axis=1) <= _ASIDE * far + _SAME)
        # Half way to a posture that is near the surface must be where it seems to be.
        good &= last | (left < distance - _NEARER * far)
        done = good & last
        ends[done] = here[done] + offset[done]
        arrived[rows[done]] = True
        going[rows[done]] = False
        x[rows[good]] = ends[good]
        length[rows[~good]] = np.minimum(length[rows[~good]], far[~good]) / 2
        length[rows[good]] = np.minimum(1.5 * length[rows[good]], _STEP)
        going[rows[(length[rows] < _SHORTEST) & ~done]] = False
        trail.append(x.copy())
    return arrived, trail


def _along(rails: ClosureManifold, q: Array, offset: Array) -> Array:
    """Parts of differences, (k, n), in the tangent spaces, that push no joint through a limit."""
    _, J = rails.kernels.residual(q, rails.goals)
    direction = offset
    free = np.ones_like(q)
    for _ in range(q.shape[1]):
        direction = offset * free
        open_ = J * free[:, None]
        square = open_ @ open_.swapaxes(1, 2)
        size = np.trace(square, axis1=1, axis2=2)[:, None, None]
        square += (_DAMPING * size + 1e-100) * np.eye(square.shape[1])
        force = np.linalg.solve(square, open_ @ direction[:, :, None])
        direction = direction - (open_.swapaxes(1, 2) @ force)[:, :, 0]
        pushed = (q <= rails.lower) & (direction < -_SAME) | (q >= rails.upper) & (
            direction > _SAME
        )
        if not pushed.any():
            break
        free[pushed] = 0.0
    return np.asarray(direction * free)


def connected(rails: ClosureManifold, nodes: Array, only: int | None = None) -> Mask:
    """Which closed postures of one arm, (count, n), walks connect with the first.

    Args:
        rails: of the arm, (1, n).
        nodes: the postures.
        only: one whose connection ends the search.
    """
    count = len(nodes)
    reached = np.zeros(count, dtype=bool)
    reached[0] = True
    distances = np.linalg.norm(
        rails.wrapped((nodes[:, None] - nodes[None]).reshape(count * count, -1)), axis=1
    ).reshape(count, count)
    tried = np.eye(count, dtype=bool)
    tries = np.zeros(count, dtype=int)
    while True:
        new = np.flatnonzero(~reached & (tries < _TRIES))
        if not len(new) or (only is not None and reached[only]):
            return reached
        apart = np.where(reached & ~tried[new], distances[new], np.inf)
        nearest = apart.argmin(axis=1)
        some = np.isfinite(apart[np.arange(len(new)), nearest])
        new, nearest = new[some], nearest[some]
        if not len(new):
            return reached
        tried[new, nearest] = True
        tries[new] += 1
        many = rails.taken(np.zeros(len(new), dtype=np.intp))
        there, _ = walk(many, nodes[new], nodes[nearest])
        back = np.flatnonzero(~there)
        if len(back):
            there[back] = walk(many.taken(back), nodes[nearest[back]], nodes[new[back]])[0]
        reached[new[there]] = True
