"""The joints of a motion along time: curves between their limits, and shares of limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.results import JointRecord, Motion


@dataclass(frozen=True, eq=False)
class JointCurves:
    """The joints of one arm over the knots of a motion."""

    # Each from −1 at its lower to 1 at its upper limit; of joints without limits in turns, or in
    # rad or m where no joint of the arm has any, (n, n_i).
    values: Array
    bounded: tuple[bool, ...]  # whether a joint has limits, by joint

    @classmethod
    def of(cls, motion: Motion, arm: str) -> JointCurves:
        """The curves of an arm."""
        assert motion.knots is not None
        q = np.array([knot.joints[arm] for knot in motion.knots])
        limits = motion.limits[arm]
        bounded = tuple(map(_bounded, limits))
        turn = 2 * np.pi if any(bounded) else 1.0
        values = [
            _range_share(q[:, i], record) if bounded[i] else q[:, i] / turn
            for i, record in enumerate(limits)
        ]
        return cls(np.column_stack(values), bounded)

    @property
    def limited(self) -> bool:
        """True where any joint has limits."""
        return any(self.bounded)

    @property
    def furthest(self) -> float:
        """The reach from 0 of a drawing that shows the curves and their limits."""
        return max(1.12, 1.05 * float(np.abs(self.values).max()))

    @property
    def unit(self) -> str:
        """The unit of the values."""
        if not self.limited:
            return "rad or m"
        return "share of range" + ("" if all(self.bounded) else "; dashed: turns")


def spread(numbers: Array, apart: float) -> Array:
    """The numbers at least some distance apart that are nearest to given ones, Σ (x − w)² → min.

    Args:
        numbers: the given numbers w, increasing, (n,).
        apart: the distance.
    """
    offsets = apart * np.arange(len(numbers))
    # Without the distances it is a regression that only may rise: merge what falls.
    groups: list[list[float]] = []
    for value in numbers - offsets:
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            last = groups.pop()
            groups[-1] += last
    fitted = [float(np.mean(group)) for group in groups for _ in group]
    return np.asarray(fitted + offsets)


def _bounded(record: JointRecord) -> bool:
    """True where a joint has both limits, and room between them."""
    return record.lower is not None and record.upper is not None and record.upper > record.lower


def _range_share(q: Array, record: JointRecord) -> Array:
    """Positions from −1 at the lower to 1 at the upper limit."""
    assert record.lower is not None and record.upper is not None
    middle, half = (record.upper + record.lower) / 2, (record.upper - record.lower) / 2
    return np.asarray((q - middle) / half)


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
    missing = {arm: (np.nan,) * len(joints) for arm, joints in motion.joint_names.items()}
    used = {
        "speed": (np.concatenate([time, halfway])[order], np.vstack([speeds, between])[order]),
        "acceleration": (time, _rows(motion, [knot.acceleration for knot in knots])),
        "torque": (time, _rows(motion, [knot.torque or missing for knot in knots])),
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
