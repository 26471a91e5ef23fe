"""What a user without copose would write: objective and closure by numpy and Pinocchio.

One Pinocchio model per arm, its data kept; joint inertia and Jacobian of each posture by Pinocchio,
what follows for several postures at once by numpy. The gradient is differenced, and since an arm's
terms depend on its own joints alone, a difference re-evaluates one arm only.
"""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
from cases import Case
from truth import Array, Truth

from copose.poses import Pose
from reference import PlanarArm

_STEP = 1e-7


class PinocchioArm:
    """J in world axes, M and tip pose of one arm, by a Pinocchio model that is kept."""

    def __init__(self, arm: object) -> None:
        """Take the model of an arm of `tests/reference.py`, or build a planar one."""
        if isinstance(arm, PlanarArm):
            self.model, self._tip = _planar_model(arm)
            self._origin = arm.base
        else:
            self.model, self._tip, self._origin = arm.model, arm.tip, arm.origin
        self._armature = np.diag(arm.armature)
        self._plain = all(joint.nq == 1 for joint in list(self.model.joints)[1:])
        self._data = self.model.createData()

    def _configuration(self, q: Array) -> Array:
        if self._plain:
            return q
        parts = []
        for joint, value in zip(list(self.model.joints)[1:], q, strict=True):
            parts += [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        return np.array(parts)

    def jacobian(self, q: Array) -> tuple[pin.SE3, Array]:
        """Tip pose and geometric Jacobian, (6, n)."""
        J = pin.computeFrameJacobian(
            self.model,
            self._data,
            self._configuration(q),
            self._tip,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        pin.updateFramePlacement(self.model, self._data, self._tip)
        R = self._origin.rotation
        return self._origin * self._data.oMf[self._tip], np.vstack([R @ J[:3], R @ J[3:]])

    def inertia(self, q: Array) -> Array:
        """M, (n, n)."""
        M = pin.crba(self.model, self._data, self._configuration(q))
        return np.triu(M) + np.triu(M, 1).T + self._armature


def _planar_model(arm: PlanarArm) -> tuple[pin.Model, int]:
    model, parent, reach = pin.Model(), 0, 0.0
    for k, link in enumerate(arm.links):
        place = pin.SE3(np.eye(3), np.array([reach, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{k + 1}")
        body = pin.Inertia(
            link["mass"], np.array([link["com"], 0.0, 0.0]), np.diag([0.0, 0.0, link["inertia"]])
        )
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        reach = link["length"]
    end = pin.SE3(np.eye(3), np.array([reach, 0.0, 0.0]))
    return model, model.addFrame(pin.Frame("tip", parent, 0, end, pin.FrameType.OP_FRAME))


class NumpyModel:
    """Cost −objective, its gradient, closure and its Jacobian, at stacked joints (N,).

    Attributes:
        truth: formulas and limits; the object is placed in it.
        lower: joint limits, margin kept, (N,); ``upper`` alike.
    """

    def __init__(self, case: Case) -> None:
        """Read the robots of a case."""
        self.truth = Truth(case)
        self._arms = [PinocchioArm(self.truth.reference.arms[name]) for name in self.truth.names]
        self._rows = self.truth.reference.rows
        self.lower, self.upper = np.concatenate(self.truth.lower), np.concatenate(self.truth.upper)
        edges = np.cumsum([0] + [len(low) for low in self.truth.lower])
        self._slices = [slice(a, b) for a, b in itertools.pairwise(edges)]

    def place(self, pose: Pose) -> None:
        """Put the object at a pose."""
        self.truth.place(pin.SE3(np.array(pose.rotation), np.array(pose.position)))

    def _terms(self, i: int, postures: Array) -> Array:
        arm = self._arms[i]
        J = np.array([arm.jacobian(q)[1][self._rows] for q in postures])
        M = np.array([arm.inertia(q) for q in postures])
        return self.truth.terms(i, J, M)

    def gram(self, q: Array) -> Array:
        """G, (a, a)."""
        parts = [self._terms(i, q[None, own]) for i, own in enumerate(self._slices)]
        return self.truth.grams(sum(parts))[0]

    def cost(self, q: Array) -> float:
        """−objective; large where there is none."""
        try:
            parts = [self._terms(i, q[None, own]) for i, own in enumerate(self._slices)]
            value = float(self.truth.values(sum(parts))[0])
        except np.linalg.LinAlgError:
            return 1e6
        return -value if np.isfinite(value) else 1e6

    def cost_and_gradient(self, q: Array) -> tuple[float, Array]:
        """−objective and its forward differences, (N,)."""
        parts = []
        for i, own in enumerate(self._slices):
            n = own.stop - own.start
            steps = np.vstack([np.zeros(n), _STEP * np.eye(n)])
            parts.append(self._terms(i, q[own] + steps))
        total = sum(part[0] for part in parts)
        moved = [total[None]] + [total + (part[1:] - part[0]) for part in parts]
        values = self.truth.values(np.concatenate(moved))
        return -float(values[0]), -(values[1:] - values[0]) / _STEP

    def closure(self, q: Array) -> Array:
        """Position error over rotation vector of the tips from their goals, (K m,)."""
        return self._closure(q)[0]

    def closure_jacobian(self, q: Array) -> Array:
        """Its derivative, (K m, N)."""
        return self._closure(q)[1]

    def _closure(self, q: Array) -> tuple[Array, Array]:
        m = len(self._rows)
        errors, slopes = [], np.zeros((m * len(self._arms), len(q)))
        for i, (arm, own) in enumerate(zip(self._arms, self._slices, strict=True)):
            tip, J = arm.jacobian(q[own])
            goal = self.truth.goals[i]
            error = goal.rotation.T @ tip.rotation
            turn = pin.log3(error)
            errors.append(np.concatenate([tip.translation - goal.translation, turn])[self._rows])
            J[3:] = pin.Jlog3(error) @ tip.rotation.T @ J[3:]
            slopes[m * i : m * i + m, own] = J[self._rows]
        return np.concatenate(errors), slopes
