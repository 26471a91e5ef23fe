"""Self-motions with one degree of freedom as curves that joint limits end.

{q : closure(q) = 0, lower ≤ q ≤ upper} of an arm with one degree of freedom to spare is made of
curves in the space of joint angles, which no limited joint leaves by a turn: arcs from limit to
limit, and loops. A curve is followed from a posture both ways. A step goes along the tangent and
back onto the curve in the plane across it, and counts only if it is straight, and if det [J; tᵀ],
t the tangent, keeps its sign: another curve nearby has the other one. Where curves meet det
vanishes, and there the search ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED

# The longest step of a search for one posture and of one for all, and the shortest, rad (or m).
STRIDE, SPACING = 0.4, 0.2
_SHORTEST = 1e-4
_MOST = 3000
# Residuals on a curve, and of what is to be told apart.
_ON_CURVE, _WELL = 1e-10, 1e-11
# Cosine between the tangents at both ends of a step, and that from which the next may be longer.
_STRAIGHT, _VERY_STRAIGHT, _ASIDE = 0.9, 0.985, 0.4
_SAME, _TOUCHING = 1e-5, 1e-9
# A joint that turns back nearer to a limit than the estimate of where is sure of, and how deep the
# turn must be to matter.
_UNSURE, _SHALLOW = 0.5, 1e-8
_HALVINGS = 40
# Of the way to where det would vanish, as it falls, that a step may go.
_OF_ROOM = 0.6
# Singular values of the closure's derivative between which it has no one tangent.
_SINGULAR = 1e-7


@dataclass(frozen=True, eq=False)
class Curve:
    """A self-motion with one degree of freedom through a posture.

    Attributes:
        points: along it in order, the posture among them, (count, n).
        tangents: there, (count, n).
        loop: whether the last is followed by the first.
        complete: whether both ends are at limits, or it is a loop.
        met: whether the target, if any, was met, which ends the search.
        stops: numbers of the joints whose limits end it.
        rails: of the arm, (1, n).
    """

    points: Array
    tangents: Array
    loop: bool
    complete: bool
    met: bool
    stops: tuple[int, ...]
    rails: ClosureManifold

    @cached_property
    def lengths(self) -> Array:
        """Along the tangent at each point to the next, (count,); zero where there is none."""
        ahead = np.roll(self.points, -1, axis=0) - self.points
        along = (self.rails.many(len(ahead)).wrapped(ahead) * self.tangents).sum(axis=1)
        return along if self.loop else np.append(along[:-1], 0.0)

    def at(self, rows: Indices, along: Array) -> tuple[Array, Mask]:
        """Postures so far behind some points, (count, n), and whether they are on the curve."""
        base, tangent = self.points[rows], self.tangents[rows]
        x, _, closed = self.rails.many(len(rows)).step(
            base, tangent, along, np.zeros_like(base), _WELL
        )
        return x, closed

    def place(self, q: Array) -> tuple[int, float] | None:
        """After which point and how far behind it a closed posture, (n,), is; None if nowhere."""
        offset = self.rails.many(len(self.points)).wrapped(q - self.points)
        along = (offset * self.tangents).sum(axis=1)
        near = (along >= -_SAME) & (along <= self.lengths + _SAME)
        near &= (offset**2).sum(axis=1) - along**2 <= (_ASIDE * self.lengths + _SAME) ** 2
        rows = np.flatnonzero(near)
        if not len(rows):
            return None
        x, closed = self.at(rows, along[rows])
        apart = np.abs(x - self.points[rows] - offset[rows]).max(axis=1)
        apart[~closed] = np.inf
        k = int(apart.argmin())
        return (int(rows[k]), float(along[rows[k]])) if apart[k] < _SAME else None


def follow(
    rails: ClosureManifold, q: Array, targets: Array | None = None, stride: float = SPACING
) -> list[Curve]:
    """The self-motions through closed postures, (k, n), one of each arm.

    Args:
        rails: of the arms.
        q: where they are.
        targets: postures, (k, n), at which the search ends; ends of curves are then not refined.
        stride: the longest step, rad (or m).
    """
    fronts = _Fronts(rails, q, targets, stride)
    # Where curves meet there is no tangent: a step that comes to nothing is no step.
    with np.errstate(all="ignore"):
        for _ in range(_MOST):
            if not fronts.going.any():
                break
            fronts.advance()
        return fronts.curves()


class _Fronts:
    """Two fronts of each arm, that go on until limits stop them or they meet."""

    def __init__(
        self, rails: ClosureManifold, q: Array, targets: Array | None, stride: float
    ) -> None:
        k, n = q.shape
        self.k, self.targets, self.stride = k, targets, stride
        arms = np.tile(np.arange(k), 2)
        self.arms, self.rails = arms, rails.taken(arms)
        _, J = rails.kernels.residual(q, rails.goals)
        tangent = np.linalg.qr(J.swapaxes(1, 2), mode="complete")[0][:, :, -1]
        det = np.linalg.det(np.concatenate([J, tangent[:, None]], axis=1))
        size = np.linalg.svd(J, compute_uv=False)
        sound = size[:, -1] > _SINGULAR * size[:, 0]
        self.q, self.tangent = q[arms], np.vstack([tangent, -tangent])
        self.det = np.concatenate([det, -det])
        self.bend, self.length = np.zeros((2 * k, n)), np.full(2 * k, stride / 2)
        self.going = sound[arms]
        self.met, self.loop = np.zeros(k, dtype=bool), np.zeros(k, dtype=bool)
        self.stops: list[int | None] = [None] * (2 * k)
        self.outside: dict[int, tuple[Array, Array, float]] = {}
        self.trails: list[list[tuple[Array, Array]]] = [
            [(q, t)] for q, t in zip(self.q, self.tangent.copy(), strict=True)
        ]

    def advance(self) -> None:
        """One step of every front that goes on."""
        rows = np.flatnonzero(self.going)
        rails = self.rails.taken(rows)
        q, t, length = self.q[rows], self.tangent[rows], self.length[rows]
        x, A, good = rails.step(q, t, length, self.bend[rows], _ON_CURVE)
        ahead, cosine, det = rails.tangents(A, t)
        aside = np.linalg.norm(x - q - length[:, None] * t, axis=1)
        good &= (cosine > _STRAIGHT) & (det * self.det[rows] > 0) & (aside < _ASIDE * length)
        shorter = np.where(good, _turning(rails, q, t, ahead, length), length / 2)
        good &= shorter == length
        self.length[rows] = shorter
        self.going[rows[shorter < _SHORTEST]] = False
        done, which = rows[good], np.flatnonzero(good)
        if not len(done):
            return
        excess = rails.excess(x, q)[which]
        out = (excess > _TOUCHING).any(axis=1)
        for row, i, k in zip(done[out], which[out], np.flatnonzero(out), strict=True):
            self.going[row] = False
            self.stops[row] = int(excess[k].argmax())
            self.outside[row] = q[i], t[i], float(length[i])
        self._look_for_targets(done)
        on = which[~out]
        self._move(done[~out], x[on], ahead[on], cosine[on], det[on])

    def _move(self, rows: Indices, x: Array, ahead: Array, cosine: Array, det: Array) -> None:
        if not len(rows):
            return
        old, new = self.q, self.q.copy()
        new[rows] = x
        taken = np.ones(len(old), dtype=bool)
        partner = (rows + self.k) % (2 * self.k)
        for points in (old, new):
            for row in self._passing(rows, points[partner], _SAME):
                arm, other = self.arms[row], (row + self.k) % (2 * self.k)
                if self.going[row] and not self.loop[arm]:
                    self.loop[arm] = True
                    # What both have come to in this step is beyond each other.
                    taken[row], taken[other] = False, points is new
        self.going &= ~self.loop[self.arms]
        for row, q, t in zip(rows, x, ahead, strict=True):
            if taken[row]:
                self.trails[row].append((q, t))
        length = self.length[rows]
        self.bend[rows] = (ahead - self.tangent[rows]) / length[:, None]
        self.tangent[rows], self.q = ahead, new
        longer = np.where(cosine > _VERY_STRAIGHT, np.minimum(1.6 * length, self.stride), length)
        # Where curves meet det vanishes: what would pass such a place has to come up to it.
        falling = np.maximum(1.0 - det / self.det[rows], 1e-9)
        room = length * (1.0 - falling) / falling
        self.length[rows] = np.minimum(longer, _OF_ROOM * room)
        self.det[rows] = det

    def _look_for_targets(self, rows: Indices) -> None:
        if self.targets is None:
            return
        targets = self.targets[self.arms]
        for row in self._passing(rows, targets[rows], -_SAME):
            # A step that ends beyond a limit may pass it on the far side.
            rails, q = self.rails.taken(np.array([row])), self.q[row][None]
            there = q + rails.wrapped(targets[row] - q)
            self.met[self.arms[row]] |= bool(rails.excess(there, q).max() <= _SAME)
        self.going &= ~self.met[self.arms]

    def _passing(self, rows: Indices, points: Array, least: float) -> list[int]:
        """Fronts whose step, about to be taken, passes a posture of each, (k, n), that lies at
        least so far along it.
        """
        q, t, length = self.q[rows], self.tangent[rows], self.length[rows]
        rails = self.rails if len(rows) == len(self.q) else self.rails.taken(rows)
        offset = rails.wrapped(points - q)
        along = (offset * t).sum(axis=1)
        near = (along >= least) & (along <= length + _SAME)
        near &= (offset**2).sum(axis=1) - along**2 <= (_ASIDE * length + _SAME) ** 2
        if not near.any():
            return []
        rows = rows[near]
        x, _, closed = self.rails.taken(rows).step(
            q[near], t[near], along[near], self.bend[rows], _WELL
        )
        same = closed & (np.abs(x - q[near] - offset[near]).max(axis=1) < _SAME)
        return list(rows[same])

    def curves(self) -> list[Curve]:
        """What was followed, arm by arm."""
        if self.targets is None:
            self._end_at_limits()
        found = []
        for arm in range(self.k):
            forward, backward = self.trails[arm], self.trails[arm + self.k]
            trail = [(q, -t) for q, t in backward[:0:-1]] + forward
            if self.loop[arm]:
                trail = forward + [(q, -t) for q, t in backward[:0:-1]]
            ends = [arm, arm + self.k]
            found.append(Curve(
                points=np.array([q for q, _ in trail]),
                tangents=np.array([t for _, t in trail]),
                loop=bool(self.loop[arm]),
                complete=bool(self.loop[arm] or all(self.stops[row] is not None for row in ends)),
                met=bool(self.met[arm]),
                stops=tuple(stop for row in ends if (stop := self.stops[row]) is not None),
                rails=self.rails.taken(np.array([arm])),
            ))  # fmt: skip
        return found

    def _end_at_limits(self) -> None:
        """Add to each trail the posture at which a limit stops it."""
        for row, (q, t, length) in self.outside.items():
            rails = self.rails.taken(np.array([row]))
            bend, low, high = self.bend[row][None], 0.0, length
            end = None
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                x, A, closed = rails.step(q[None], t[None], np.array([middle]), bend, _WELL)
                if closed[0] and (rails.excess(x, q[None]) <= 0).all():
                    low, end = middle, (x[0], rails.tangents(A, t[None])[0][0])
                else:
                    high = middle
            if end is not None and low > CLOSED:
                self.trails[row].append(end)


def _turning(rails: ClosureManifold, q: Array, t: Array, ahead: Array, length: Array) -> Array:
    """Lengths of steps, (k,), shorter where a joint turns back on the way and may be beyond a limit
    where it does.
    """
    speed, slower = np.abs(t), np.abs(ahead)
    turns = t * ahead < 0
    if not turns.any():
        return length
    total = np.where(turns, speed + slower, 1.0)
    depth = length[:, None] * speed**2 / (2 * total)
    beyond = rails.excess(q + np.sign(t) * (1 + _UNSURE) * depth, q) > 0
    least = np.minimum(depth, length[:, None] * slower**2 / (2 * total))
    doubtful = turns & beyond & (least > _SHALLOW)
    part = np.where(doubtful, np.clip(speed / total, 0.1, 0.8), 1.0).min(axis=1)
    return np.asarray(length * part)
