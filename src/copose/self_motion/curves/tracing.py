"""Tracing of self-motions with one degree of freedom, by predictor and corrector, up to limits.

{q : closure(q) = 0, lower ≤ q ≤ upper} of an arm with one degree of freedom to spare is made of
curves in the space of joint angles, which no limited joint leaves by a turn: arcs from limit to
limit, and loops. A curve is traced from a posture both ways. A step goes along the tangent and back
onto the curve in the plane across it, and counts only if it is straight, and if det [J; tᵀ], t the
tangent, keeps its sign: another curve nearby has the other one. Where curves meet det vanishes, and
there the trace ends.

`Loops` is the coarse tracer beside this one: it covers all self-motions of an arm, limits aside, by
points that are far apart, and may cross over to a curve nearby without harm.
"""

from __future__ import annotations

import numpy as np

from copose.poses import Array, Indices
from copose.self_motion.curves.curve import Curve, TracingOptions
from copose.self_motion.manifold import ClosureManifold, null_vectors
from copose.self_motion.projection import CLOSED


def follow(
    rails: ClosureManifold,
    q: Array,
    targets: Array | None = None,
    options: TracingOptions | None = None,
) -> list[Curve]:
    """The self-motions through closed postures, one of each arm.

    Args:
        rails: of the arms.
        q: their postures, (k, n).
        targets: postures, (k, n), at which the trace ends; ends of curves are then not refined.
        options: step lengths and tolerances.
    """
    options = options or TracingOptions()
    fronts = _Fronts(rails, q, targets, options)
    # Where curves meet there is no tangent: a step that comes to nothing is no step.
    with np.errstate(all="ignore"):
        for _ in range(options.steps):
            if not fronts.going.any():
                break
            fronts.advance()
        return fronts.curves()


class _Fronts:
    """Two fronts of each arm that go on until limits stop them or they meet."""

    def __init__(
        self, rails: ClosureManifold, q: Array, targets: Array | None, options: TracingOptions
    ) -> None:
        k, n = q.shape
        self.k, self.targets, self.options = k, targets, options
        arms = np.tile(np.arange(k), 2)
        self.arms, self.rails = arms, rails.taken(arms)
        _, J = rails.kernels.residual(q, rails.goals)
        tangent = null_vectors(J)
        det = np.linalg.det(np.concatenate([J, tangent[:, None]], axis=1))
        size = np.linalg.svd(J, compute_uv=False)
        sound = size[:, -1] > options.singular * size[:, 0]
        self.q, self.tangent = q[arms], np.vstack([tangent, -tangent])
        self.det = np.concatenate([det, -det])
        self.bend, self.length = np.zeros((2 * k, n)), np.full(2 * k, options.longest / 2)
        self.going = sound[arms]
        self.met, self.loop = np.zeros(k, dtype=bool), np.zeros(k, dtype=bool)
        self.stops: list[int | None] = [None] * (2 * k)
        self.outside: dict[int, tuple[Array, Array, float]] = {}
        self.trails: list[list[tuple[Array, Array]]] = [
            [(q, t)] for q, t in zip(self.q, self.tangent.copy(), strict=True)
        ]

    def advance(self) -> None:
        """One step of every front that goes on."""
        options = self.options
        rows = np.flatnonzero(self.going)
        rails = self.rails.taken(rows)
        q, t, length = self.q[rows], self.tangent[rows], self.length[rows]
        x, A, good = rails.step(q, t, length, self.bend[rows], options.closed)
        ahead, cosine, det = rails.tangents(A, t)
        aside = np.linalg.norm(x - q - length[:, None] * t, axis=1)
        good &= (cosine > options.straight) & (det * self.det[rows] > 0)
        good &= aside < options.aside * length
        shorter = np.where(good, _turning(rails, q, t, ahead, length, options), length / 2)
        good &= shorter == length
        self.length[rows] = shorter
        self.going[rows[shorter < options.shortest]] = False
        done, which = rows[good], np.flatnonzero(good)
        if not len(done):
            return
        excess = rails.excess(x, q)[which]
        out = (excess > options.touching).any(axis=1)
        for row, i, k in zip(done[out], which[out], np.flatnonzero(out), strict=True):
            self.going[row] = False
            self.stops[row] = int(excess[k].argmax())
            self.outside[row] = q[i], t[i], float(length[i])
        self._look_for_targets(done)
        on = which[~out]
        self._move(done[~out], x[on], ahead[on], cosine[on], det[on])

    def _move(self, rows: Indices, x: Array, ahead: Array, cosine: Array, det: Array) -> None:
        """Move fronts to new points, close loops where partners meet, and choose the next steps."""
        if not len(rows):
            return
        old, new = self.q, self.q.copy()
        new[rows] = x
        taken = np.ones(len(old), dtype=bool)
        partner = (rows + self.k) % (2 * self.k)
        for points in (old, new):
            for row in self._passing(rows, points[partner], self.options.same):
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
        options = self.options
        longer = np.minimum(options.growth * length, options.longest)
        longer = np.where(cosine > options.very_straight, longer, length)
        # Where curves meet det vanishes: what would pass such a place has to come up to it.
        falling = np.maximum(1.0 - det / self.det[rows], 1e-9)
        room = length * (1.0 - falling) / falling
        self.length[rows] = np.minimum(longer, options.room * room)
        self.det[rows] = det

    def _look_for_targets(self, rows: Indices) -> None:
        """End the traces whose step, about to be taken, passes their target."""
        if self.targets is None:
            return
        targets = self.targets[self.arms]
        for row in self._passing(rows, targets[rows], -self.options.same):
            # A step that ends beyond a limit may pass it on the far side.
            rails, q = self.rails.taken(np.array([row])), self.q[row][None]
            target = q + rails.wrapped(targets[row] - q)
            self.met[self.arms[row]] |= bool(rails.excess(target, q).max() <= self.options.same)
        self.going &= ~self.met[self.arms]

    def _passing(self, rows: Indices, points: Array, least: float) -> list[int]:
        """Fronts whose step, about to be taken, passes a posture of each.

        Args:
            rows: of the fronts, (k,).
            points: the postures, (k, n).
            least: distance of a posture along the step, at least.
        """
        options = self.options
        q, t, length = self.q[rows], self.tangent[rows], self.length[rows]
        rails = self.rails if len(rows) == len(self.q) else self.rails.taken(rows)
        offset = rails.wrapped(points - q)
        along = (offset * t).sum(axis=1)
        near = (along >= least) & (along <= length + options.same)
        near &= (offset**2).sum(axis=1) - along**2 <= (options.aside * length + options.same) ** 2
        if not near.any():
            return []
        rows = rows[near]
        x, _, closed = self.rails.taken(rows).step(
            q[near], t[near], along[near], self.bend[rows], options.closed_well
        )
        same = closed & (np.abs(x - q[near] - offset[near]).max(axis=1) < options.same)
        return list(rows[same])

    def curves(self) -> list[Curve]:
        """The traced curves, arm by arm."""
        if self.targets is None:
            self._end_at_limits()
        curves = []
        for arm in range(self.k):
            forward, backward = self.trails[arm], self.trails[arm + self.k]
            trail = [(q, -t) for q, t in backward[:0:-1]] + forward
            if self.loop[arm]:
                trail = forward + [(q, -t) for q, t in backward[:0:-1]]
            ends = [arm, arm + self.k]
            curves.append(Curve(
                points=np.array([q for q, _ in trail]),
                tangents=np.array([t for _, t in trail]),
                loop=bool(self.loop[arm]),
                complete=bool(self.loop[arm] or all(self.stops[row] is not None for row in ends)),
                met=bool(self.met[arm]),
                stops=tuple(stop for row in ends if (stop := self.stops[row]) is not None),
                rails=self.rails.taken(np.array([arm])),
                options=self.options,
            ))  # fmt: skip
        return curves

    def _end_at_limits(self) -> None:
        """Add to each trail the posture at which a limit stops it."""
        for row, (q, t, length) in self.outside.items():
            rails = self.rails.taken(np.array([row]))
            bend, low, high = self.bend[row][None], 0.0, length
            end = None
            for _ in range(self.options.halvings):
                middle = (low + high) / 2
                x, A, closed = rails.step(
                    q[None], t[None], np.array([middle]), bend, self.options.closed_well
                )
                if closed[0] and (rails.excess(x, q[None]) <= 0).all():
                    low, end = middle, (x[0], rails.tangents(A, t[None])[0][0])
                else:
                    high = middle
            if end is not None and low > CLOSED:
                self.trails[row].append(end)


def _turning(
    rails: ClosureManifold, q: Array, t: Array, ahead: Array, length: Array, options: TracingOptions
) -> Array:
    """Lengths of steps, shorter where a joint turns back on the way, maybe beyond a limit: (k,).

    Args:
        rails: of the fronts.
        q: where the steps begin, (k, n).
        t: tangents there, (k, n).
        ahead: tangents at their ends, (k, n).
        length: of the steps, (k,).
        options: of tracing.
    """
    speed, slower = np.abs(t), np.abs(ahead)
    turns = t * ahead < 0
    if not turns.any():
        return length
    total = np.where(turns, speed + slower, 1.0)
    depth = length[:, None] * speed**2 / (2 * total)
    beyond = rails.excess(q + np.sign(t) * (1 + options.unsure) * depth, q) > 0
    least = np.minimum(depth, length[:, None] * slower**2 / (2 * total))
    doubtful = turns & beyond & (least > options.shallow)
    part = np.where(doubtful, np.clip(speed / total, 0.1, 0.8), 1.0).min(axis=1)
    return np.asarray(length * part)
