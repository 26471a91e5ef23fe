"""Where a path has its object, by numpy alone: waypoints, minimum jerk, shortest rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TURN = 0.3  # m that an angle of one radian counts as


@dataclass(frozen=True)
class Moving:
    """The object at a time; a plane's third coordinate, and its other two angles, are zero."""

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray
    acceleration: np.ndarray
    alpha: np.ndarray


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """I + sin a S + (1 − cos a) S², S = axis ×."""
    x, y, z = axis
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * S + (1 - math.cos(angle)) * (S @ S)


def from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    x, y, z = np.eye(3)
    return about(z, yaw) @ about(y, pitch) @ about(x, roll)


def axis_angle(R: np.ndarray) -> tuple[np.ndarray, float]:
    """The axis and the angle, 0 … π, of a rotation."""
    # R = exp(angle S) has the axis as eigenvector of 1; the skew part gives sense and sine.
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = float(np.linalg.norm(skew))
    angle = math.atan2(sine, (np.trace(R) - 1) / 2)
    if sine == 0 and angle == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    if sine > 1e-6 or angle < 1:
        return skew / sine, angle
    values, vectors = np.linalg.eigh((R + R.T) / 2)
    axis = vectors[:, np.argmax(values)]
    return (axis if axis @ skew >= 0 else -axis), angle


class ObjectPath:
    """The law of a problem's ``[path]``, for a duration in seconds."""

    def __init__(self, tables: dict, duration: float | None = None) -> None:
        path, thing = tables["path"], tables["object"]
        given = path.get("duration", 2.0)
        self.duration = float(given if duration is None else duration)
        self.planar = tables["task"]["space"].startswith("planar")
        turn = "angle" if self.planar else "rpy"
        still = 0.0 if self.planar else [0.0, 0.0, 0.0]
        here = {"position": thing["position"], turn: thing.get(turn, still)}
        self.places = []
        for waypoint in path["waypoints"]:
            here = here | waypoint
            self.places.append(self._place(here["position"], here[turn]))
        self.axes, self.angles, lengths = [], [], []
        for (p, R, a), (p_next, R_next, a_next) in zip(self.places, self.places[1:], strict=False):
            if self.planar:
                axis, angle = np.array([0.0, 0.0, 1.0]), math.remainder(a_next - a, 2 * math.pi)
            else:
                axis, angle = axis_angle(R.T @ R_next)
                axis = R @ axis
            self.axes.append(axis)
            self.angles.append(angle)
            lengths.append(max(float(np.linalg.norm(p_next - p)), TURN * abs(angle)))
        total = sum(lengths)
        self.ends = self.duration * np.cumsum([0.0, *lengths]) / (total if total > 0 else 1.0)

    def _place(self, position, turn) -> tuple[np.ndarray, np.ndarray, float]:
        if self.planar:
            return np.array([*position, 0.0], dtype=float), from_rpy(0.0, 0.0, turn), float(turn)
        return np.array(position, dtype=float), from_rpy(*turn), 0.0

    def at(self, time: float) -> Moving:
        """The object at a time, s; at rest before the first waypoint and after the last."""
        k = int(np.clip(np.searchsorted(self.ends, time, side="right") - 1, 0, len(self.axes) - 1))
        while k > 0 and self.ends[k + 1] == self.ends[k]:
            k -= 1
        p, R, _ = self.places[k]
        step, span = self.places[k + 1][0] - p, self.ends[k + 1] - self.ends[k]
        turn = self.angles[k] * self.axes[k]
        if span == 0:
            zero = np.zeros(3)
            return Moving(p, R, zero, zero, zero, zero)
        x = min(max((time - self.ends[k]) / span, 0.0), 1.0)
        s = x**3 * (10 - 15 * x + 6 * x**2)
        ds = 30 * x**2 * (1 - x) ** 2 / span
        dds = 60 * x * (1 - x) * (1 - 2 * x) / span**2
        return Moving(
            p + s * step, about(self.axes[k], s * self.angles[k]) @ R,
            ds * step, ds * turn, dds * step, dds * turn,
        )  # fmt: skip
