"""The joints of a motion as curves between their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.results import JointRecord, Motion


@dataclass(frozen=True, eq=False)
class JointCurves:
    """The joints of one arm over the knots of a motion.

    Attributes:
        values: each from −1 at its lower to 1 at its upper limit; of joints without limits in
            turns, or in rad or m where no joint of the arm has any, (n, n_i).
        bounded: whether a joint has limits, by joint.
    """

    values: Array
    bounded: tuple[bool, ...]

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
