"""Closed postures of single arms, many at once: numpy kinematics over Pinocchio's numbers.

Independent of copose: placements, axes and limits are read from the Pinocchio model, random starts
are pulled to the grasp by damped least squares within the limits.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from truth import Array, Truth

from reference import PlanarArm

CLOSED = 1e-10
_STEPS = 120
_LONGEST = 0.4
_BATCH = 2048


class Kinematics:
    """Tip poses and Jacobians of postures (count, n) of one arm, in world axes."""

    def __init__(self, arm: object) -> None:
        """Read an arm of `tests/reference.py`."""
        if isinstance(arm, PlanarArm):
            self._base = arm.base
            lengths = [0.0] + [link["length"] for link in arm.links]
            frames = [pin.SE3(np.eye(3), np.array([a, 0.0, 0.0])) for a in lengths]
            self._placements, self._tip = frames[:-1], frames[-1]
            self._axes = np.tile([0.0, 0.0, 1.0], (len(arm.links), 1))
            self._slides = np.zeros(len(arm.links), dtype=bool)
            return
        model = arm.model
        data = model.createData()
        J = pin.computeJointJacobians(model, data, pin.neutral(model))
        frame = model.frames[arm.tip]
        assert frame.parentJoint == model.njoints - 1, "the chain's last joint carries the tip"
        self._base, self._tip = arm.origin, frame.placement
        self._placements = list(model.jointPlacements)[1:]
        self._slides = np.linalg.norm(J[3:], axis=0) < 0.5
        turned = [data.oMi[k + 1].rotation.T for k in range(model.nv)]
        parts = [J[:3, k] if slides else J[3:, k] for k, slides in enumerate(self._slides)]
        self._axes = np.array([R @ part for R, part in zip(turned, parts, strict=True)])

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Tip positions (count, 3), rotations (count, 3, 3), Jacobians (count, 6, n)."""
        count, n = q.shape
        R = np.broadcast_to(self._base.rotation, (count, 3, 3))
        p = np.broadcast_to(self._base.translation, (count, 3))
        origins, axes = np.empty((n, count, 3)), np.empty((n, count, 3))
        for k, placement in enumerate(self._placements):
            p = p + R @ placement.translation
            R = R @ placement.rotation
            axes[k], axis = R @ self._axes[k], self._axes[k]
            if self._slides[k]:
                p = p + axes[k] * q[:, k, None]
            else:
                R = R @ _turns(axis, q[:, k])
            origins[k] = p
        p, R = p + R @ self._tip.translation, R @ self._tip.rotation
        linear = np.where(self._slides[:, None, None], axes, np.cross(axes, p - origins))
        angular = np.where(self._slides[:, None, None], 0.0, axes)
        return p, R, np.concatenate([linear, angular], axis=2).transpose(1, 2, 0)


def _turns(axis: Array, angle: Array) -> Array:
    """Rotations about a unit axis, (count, 3, 3), by Rodrigues."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * K + (1 - cosine) * (K @ K)


def rotation_vectors(R: Array) -> Array:
    """Logarithms of rotations, (count, 3, 3) → (count, 3)."""
    skew = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
    sine = np.linalg.norm(skew, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    return skew / 2 * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)[:, None]


def project(truth: Truth, i: int, q: Array) -> tuple[Array, Array]:
    """Postures (count, n) of arm i pulled to its grasp, and the gaps that remain, (count,).

    Damped least squares; joints that press against a limit stand still for the step.
    """
    kinematics = Kinematics(truth.reference.arms[truth.names[i]])
    ends, gaps = np.clip(q, truth.lower[i], truth.upper[i]), np.full(len(q), np.inf)
    open_rows = np.arange(len(q))
    for step in range(_STEPS):
        error, J = _residuals(truth, i, kinematics, ends[open_rows])
        gaps[open_rows] = np.linalg.norm(error, axis=1)
        left = gaps[open_rows] > CLOSED / 100
        open_rows, error, J = open_rows[left], error[left], J[left]
        if step == _STEPS - 1 or not len(open_rows):
            break
        ends[open_rows] = _stepped(truth, i, ends[open_rows], error, J)
    return ends, gaps


def _residuals(truth: Truth, i: int, kinematics: Kinematics, q: Array) -> tuple[Array, Array]:
    """Goal minus tip, position over rotation vector in task rows, (count, m), and J."""
    goal, rows = truth.goals[i], truth.reference.rows
    p, R, J = kinematics.at(q)
    turn = rotation_vectors(goal.rotation @ np.swapaxes(R, 1, 2))
    return np.concatenate([goal.translation - p, turn], axis=1)[:, rows], J[:, rows]


def _stepped(truth: Truth, i: int, q: Array, error: Array, J: Array) -> Array:
    """One damped step, Jᵀ(J Jᵀ + λI)⁻¹e, of bounded length and within the limits."""
    lower, upper = truth.lower[i], truth.upper[i]
    damping = np.minimum(1e-2, np.sum(error**2, axis=1)) + 1e-14
    free, move = np.ones(q.shape, dtype=bool), np.zeros_like(q)
    for _ in range(2):
        held = J * free[:, None, :]
        JJ = held @ np.swapaxes(held, 1, 2) + damping[:, None, None] * np.eye(error.shape[1])
        move = (np.swapaxes(held, 1, 2) @ np.linalg.solve(JJ, error[:, :, None]))[:, :, 0]
        free &= ~(((q <= lower) & (move < 0)) | ((q >= upper) & (move > 0)))
    longest = np.abs(move).max(axis=1, keepdims=True)
    move = move * free * np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-300))
    return np.clip(q + move, lower, upper)


def wrapped(truth: Truth, i: int, q: Array) -> Array:
    """Postures with every revolute joint in (−π, π] where its limits allow that."""
    turned = nearest_turn(truth, i, q)
    allowed = (turned >= truth.lower[i]) & (turned <= truth.upper[i])
    return np.where(allowed, turned, q)


def nearest_turn(truth: Truth, i: int, q: Array) -> Array:
    """Positions or differences of arm i with every revolute joint in (−π, π]."""
    return np.where(truth.revolute[i], np.pi - np.mod(np.pi - q, 2 * np.pi), q)


def closed_postures(truth: Truth, i: int, starts: int, seed: int) -> Array:
    """Closed postures of arm i from that many random starts, (count, n)."""
    rng = np.random.default_rng([seed, i])
    lower, upper = truth.lower[i], truth.upper[i]
    low = np.where(np.isfinite(lower), lower, -np.pi)
    high = np.where(np.isfinite(upper), upper, np.pi)
    found = []
    for begin in range(0, starts, _BATCH):
        drawn = rng.uniform(low, high, (min(_BATCH, starts - begin), len(low)))
        q, gap = project(truth, i, drawn)
        found.append(wrapped(truth, i, q[gap < CLOSED]))
    return np.concatenate(found)


def closed_starts(truth: Truth, count: int, seed: int) -> Array:
    """Closed postures of all arms, stacked, (count, N): random, the same for every method."""
    arms = []
    for i in range(len(truth.names)):
        q, tries = np.empty((0, len(truth.lower[i]))), 0
        while len(q) < count and tries < 64:
            more = closed_postures(truth, i, max(256, count // 2), seed + 1000 * tries)
            q, tries = np.concatenate([q, more]), tries + 1
        rng = np.random.default_rng([seed, i, 7])
        arms.append(q[rng.permutation(len(q))[:count]])
    shortest = min(map(len, arms))
    return np.hstack([q[:shortest] for q in arms])


def spread_out(truth: Truth, i: int, q: Array, count: int) -> Array:
    """At most ``count`` of the postures, each the farthest from those before it."""
    if len(q) == 0:
        return q
    chosen = [0]
    nearest = distances(truth, i, q, q[0])
    while len(chosen) < min(count, len(q)):
        chosen.append(int(np.argmax(nearest)))
        if nearest[chosen[-1]] < 1e-3:
            chosen.pop()
            break
        nearest = np.minimum(nearest, distances(truth, i, q, q[chosen[-1]]))
    return q[chosen]


def distances(truth: Truth, i: int, q: Array, other: Array) -> Array:
    """Largest difference of a joint, turns aside; any shapes that broadcast."""
    return np.abs(nearest_turn(truth, i, q - other)).max(axis=-1)
