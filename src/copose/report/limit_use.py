"""Shares of their limits that the joints of a motion use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.results import Knot, Motion


@dataclass(frozen=True, eq=False)
class LimitShare:
    """The largest share of one kind of limit that joints use, along time."""

    kind: str  # speed, acceleration or torque
    time: Array  # s, (k,)
    values: Array  # the largest over the joints, NaN where it is unknown, (k,)
    joints: tuple[str, ...]  # the joints that use it, ``arm/joint``

    @property
    def largest(self) -> tuple[float, str, float]:
        """The largest share of all, its joint and its time."""
        k = int(np.nanargmax(self.values))
        return float(self.values[k]), self.joints[k], float(self.time[k])


def limit_shares(motion: Motion) -> list[LimitShare]:
    """Shares of every kind of limit that a joint has, where the motion states what it uses."""
    assert motion.time is not None and motion.knots is not None
    time, knots = np.array(motion.time), motion.knots
    speeds = _rows(motion, [knot.velocity for knot in knots])
    positions = _rows(motion, [knot.joints for knot in knots])
    # The limit holds for the mean speed from knot to knot as well: it stands half-way.
    between = np.diff(positions, axis=0) / np.diff(time)[:, None]
    halfway = (time[:-1] + time[1:]) / 2
    order = np.argsort(np.concatenate([time, halfway]))
    used = {
        "speed": (np.concatenate([time, halfway])[order], np.vstack([speeds, between])[order]),
        "acceleration": (time, _rows(motion, [knot.acceleration for knot in knots])),
        "torque": (time, _rows(motion, [_torque(motion, knot) for knot in knots])),
    }
    names = [f"{arm}/{joint}" for arm, joints in motion.joint_names.items() for joint in joints]
    shares = []
    for kind, (when, values) in used.items():
        share = np.abs(values) / _limits(motion, "velocity" if kind == "speed" else kind)
        # A comparison with NaN is false: unknown numbers are never the largest.
        known = np.where(np.isfinite(share), share, -1.0)
        worst = known.argmax(axis=1)
        largest = known[np.arange(len(known)), worst]
        if (largest >= 0).any():
            largest = np.where(largest >= 0, largest, np.nan)
            shares.append(LimitShare(kind, when, largest, tuple(names[i] for i in worst)))
    return shares


def _limits(motion: Motion, kind: str) -> Array:
    """Limits of all joints, NaN where there is none that lets them move, (N,)."""
    records = [record for arm in motion.joint_names for record in motion.limits[arm]]
    limits = np.array([getattr(record, kind) for record in records], dtype=float)
    return np.where(limits > 0, limits, np.nan)


def _rows(motion: Motion, parts: list[dict[str, tuple[float, ...]]]) -> Array:
    """Numbers by arm at some times as rows of all joints."""
    return np.array([[x for arm in motion.joint_names for x in part[arm]] for part in parts])


def _torque(motion: Motion, knot: Knot) -> dict[str, tuple[float, ...]]:
    """Torques at a knot, NaN where it does not state them."""
    missing = {arm: (np.nan,) * len(joints) for arm, joints in motion.joint_names.items()}
    return missing if knot.torque is None else knot.torque
