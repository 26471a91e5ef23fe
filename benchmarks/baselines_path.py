"""What follows a path without planning: least-norm tracking and gradient projection, in numpy.

q̇ = J⁺V, or q̇ = J⁺V + k (I − J⁺J) ∇f with f the objective, from a closed posture, knot by knot; V is
the contacts' velocity. A joint at its limit that would go beyond stands still and the others do the
rest, if they can. Both are spared what a planner is asked for: the pull of the objective may change
at once, and need not vanish at the ends.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from building import Tables
from cases import Case
from numpy_model import NumpyModel, PinocchioArm
from sampling import closed_starts
from truth import Array

from copose.robots import load_arms
from object_path import Moving, ObjectPath
from reference import pose

STEPS = 4  # between two knots
GAINS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
_AT_LIMIT, _CLOSED, _OFF = 1e-9, 1e-10, 1e-6


@dataclass(frozen=True)
class Tracked:
    """A motion without planning.

    Attributes:
        q: of all arms at the knots, up to where it fails, (knots, N).
        values: the objective there.
        reason: why it fails, None where it gets to the end.
        gain: k, 0 for least-norm tracking.
    """

    q: Array
    values: Array
    reason: str | None
    gain: float

    def aggregate(self, mode: str) -> float:
        """The mean or the worst over the knots; −inf where it does not get to the end."""
        if self.reason is not None:
            return -np.inf
        return float(np.min(self.values) if mode == "worst" else np.mean(self.values))


class Tracker:
    """A problem with a path, to be followed from any closed posture.

    Attributes:
        path: where the object is.
        time: of the knots.
        mode: how values are aggregated.
        parts: where each arm's joints are among all.
    """

    def __init__(self, tables: Tables) -> None:
        """Read the robots."""
        case = Case(tables["name"], "", tables)
        self.path = ObjectPath(tables)
        self.time = np.linspace(0.0, self.path.duration, tables["path"].get("knots", 50))
        self.mode: str = tables["path"].get("aggregate", "mean")
        self._model = NumpyModel(case)
        truth = self._model.truth
        self._fastest = [
            np.array([joint.velocity for joint in arm.joints]) for arm in load_arms(case.problem)
        ]
        self._arms = [PinocchioArm(truth.reference.arms[name]) for name in truth.names]
        self._grasps = [pose(arm["grasp"]) for arm in tables["arms"]]
        edges = np.cumsum([0] + [len(low) for low in truth.lower])
        self.parts = [slice(a, b) for a, b in itertools.pairwise(edges)]

    def starts(self, count: int, seed: int) -> Array:
        """Random closed postures at the first waypoint, (count, N)."""
        self._place(self.path.at(0.0))
        return closed_starts(self._model.truth, count, seed)

    def follow(self, start: Array, gain: float = 0.0, *, hold: bool = True) -> Tracked:
        """The motion from a closed posture.

        Args:
            start: all arms', (N,).
            gain: k of the objective's gradient; 0 for least-norm tracking.
            hold: let joints stand at their limits; else the first that gets there ends it.
        """
        q, reason = np.array(start, dtype=float), None
        found, values = [q], [self._value(q, 0.0)]
        for t, t_next in itertools.pairwise(self.time):
            q, reason = self._step(q, t, t_next, gain, hold)
            if reason is not None:
                break
            for i, part in enumerate(self.parts):
                fast = np.abs(q[part] - found[-1][part]) / (t_next - t) - self._fastest[i]
                if fast.max() > 1e-9:
                    reason = f"arm {i}, joint {fast.argmax() + 1} is too fast at {t_next:.3f} s"
            if reason is not None:
                break
            found.append(q)
            values.append(self._value(q, t_next))
        return Tracked(np.array(found), np.array(values), reason, gain)

    def best_of(self, start: Array, gains: tuple[float, ...] = GAINS) -> Tracked:
        """Gradient projection with the gain that serves it best."""
        return max((self.follow(start, gain) for gain in gains), key=self._rank)

    def _rank(self, tracked: Tracked) -> tuple[float, int]:
        return tracked.aggregate(self.mode), len(tracked.q)

    def speeds(self, q: Array, time: float) -> Array:
        """J⁺V, (N,)."""
        now = self.path.at(time)
        return np.concatenate([
            np.linalg.pinv(self._tip(i, q[part])[1]) @ self._twist(i, now)
            for i, part in enumerate(self.parts)
        ])  # fmt: skip

    def _step(
        self, q: Array, begin: float, end: float, gain: float, hold: bool
    ) -> tuple[Array, str | None]:
        """By the midpoint rule, closed again after every step."""
        h = (end - begin) / STEPS
        for k in range(STEPS):
            t = begin + k * h
            half, reason = self._rates(q, t, gain, hold)
            if reason is None:
                half, reason = self._rates(q + h / 2 * half, t + h / 2, gain, hold)
            if reason is not None:
                return q, reason
            q, reason = self._closed(q + h * half, t + h)
            if reason is not None:
                return q, reason
        return q, None

    def _rates(self, q: Array, time: float, gain: float, hold: bool) -> tuple[Array, str | None]:
        now, truth = self.path.at(time), self._model.truth
        pull = np.zeros(len(q))
        if gain > 0:
            self._place(now)
            pull = -gain * self._model.cost_and_gradient(q)[1]
        rates = np.zeros(len(q))
        for i, part in enumerate(self.parts):
            J, V = self._tip(i, q[part])[1], self._twist(i, now)
            low, high = truth.lower[i] + _AT_LIMIT, truth.upper[i] - _AT_LIMIT
            free = np.ones(J.shape[1], dtype=bool)
            while True:
                held = J * free
                pinv = np.linalg.pinv(held, rcond=1e-9)
                least, own = pinv @ V, pull[part] * free
                own = own - pinv @ (held @ own)
                rate = least + _share(least, own, self._fastest[i]) * own
                rate = np.where(free, rate, 0.0)
                pressed = ((q[part] <= low) & (rate < 0)) | ((q[part] >= high) & (rate > 0))
                if not pressed.any():
                    break
                if not hold:
                    return rates, f"arm {i}, joint {pressed.argmax() + 1} is at its limit"
                free &= ~pressed
            if np.abs(J @ rate - V).max() > _OFF:
                return rates, f"arm {i} cannot follow at {time:.3f} s with joints at their limits"
            rates[part] = rate
        return rates, None

    def _closed(self, q: Array, time: float) -> tuple[Array, str | None]:
        now, truth, ends = self.path.at(time), self._model.truth, q.copy()
        for i, part in enumerate(self.parts):
            goal = pin.SE3(now.rotation, now.position) * self._grasps[i]
            mine = np.clip(q[part], truth.lower[i], truth.upper[i])
            for _ in range(20):
                tip, J = self._tip(i, mine)
                turn = pin.log3(goal.rotation @ tip.rotation.T)
                gap = np.concatenate([goal.translation - tip.translation, turn])
                gap = gap[truth.reference.rows]
                if np.abs(gap).max() < _CLOSED:
                    break
                move = np.linalg.pinv(J) @ gap
                stuck = ((mine <= truth.lower[i]) & (move < 0)) | (
                    (mine >= truth.upper[i]) & (move > 0)
                )
                if stuck.any():
                    move = np.linalg.pinv(J * ~stuck, rcond=1e-9) @ gap
                mine = np.clip(mine + move, truth.lower[i], truth.upper[i])
            else:
                return ends, f"arm {i} does not reach its grasp at {time:.3f} s"
            ends[part] = mine
        return ends, None

    def _tip(self, i: int, q: Array) -> tuple[pin.SE3, Array]:
        tip, J = self._arms[i].jacobian(q)
        return tip, J[self._model.truth.reference.rows]

    def _twist(self, i: int, now: Moving) -> Array:
        r = now.rotation @ self._grasps[i].translation
        twist = np.concatenate([now.velocity + np.cross(now.omega, r), now.omega])
        return twist[self._model.truth.reference.rows]

    def _place(self, now: Moving) -> None:
        self._model.truth.place(pin.SE3(now.rotation, now.position))

    def _value(self, q: Array, time: float) -> float:
        self._place(self.path.at(time))
        return -self._model.cost(q)


def _share(least: Array, own: Array, fastest: Array) -> float:
    """The largest share of self-motion, at most all, that keeps every joint within its speed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        room = (fastest - np.sign(own) * least) / np.abs(own)
    return float(np.clip(np.min(room[own != 0], initial=1.0), 0.0, 1.0))
