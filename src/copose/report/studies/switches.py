"""Switches of posture along a curve: where the best posture leaves one branch for another."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.poses import Array


@dataclass(frozen=True)
class SwitchRule:
    """When a step of an arm between two neighbours is a switch."""

    least: float = 0.3  # rad or m that its joint which moves most moves at least
    times: float = 4.0  # the arm's usual step, the median over all neighbours
    most_points: int = 5000  # beyond so many points none is looked for


@dataclass(frozen=True)
class Switch:
    """A step from one branch to another.

    Attributes:
        at: where along the axis, midway between the two neighbours.
        arms: that take it.
    """

    at: float
    arms: tuple[str, ...]


def branch_switches(
    along: Array, joints: Sequence[Mapping[str, Any] | None], rule: SwitchRule = SwitchRule()
) -> list[Switch]:
    """The switches along a curve.

    The step of an arm is max_k |Δq_k| between two neighbours without whole turns. Where the best
    posture stays on its branch, it follows the point smoothly and steps are in proportion to the
    distance of the neighbours; so a switch is a step that is larger than ``rule.least`` and larger
    than ``rule.times`` its arm's median rate times that distance.

    Args:
        along: places on the axis, ascending.
        joints: at each by arm, or by case and arm; None where there is no posture, and no
            neighbour.
        rule: the rule.
    """
    by_arm = [None if each is None else _flat(each) for each in joints]
    pairs = [
        i for i in range(len(along) - 1) if by_arm[i] is not None and by_arm[i + 1] is not None
    ]
    if not pairs:
        return []
    apart = np.maximum(np.diff(along)[pairs], 1e-300)
    jumping: dict[int, list[str]] = {}
    for arm in by_arm[pairs[0]] or ():
        steps = np.array([_step(by_arm[i], by_arm[i + 1], arm) for i in pairs])
        usual = float(np.median(steps / apart))
        for k in np.flatnonzero((steps > rule.least) & (steps > rule.times * usual * apart)):
            jumping.setdefault(pairs[int(k)], []).append(arm)
    return [
        Switch(float(along[i] + along[i + 1]) / 2, tuple(arms))
        for i, arms in sorted(jumping.items())
    ]


def _flat(joints: Mapping[str, Any]) -> dict[str, Array]:
    """Joints by arm; of cases by case and arm."""
    flat = dict[str, Array]()
    for name, entry in joints.items():
        if isinstance(entry, Mapping):
            flat |= {f"{name} {arm}": np.array(q, dtype=float) for arm, q in entry.items()}
        else:
            flat[name] = np.array(entry, dtype=float)
    return flat


def _step(one: dict[str, Array] | None, other: dict[str, Array] | None, arm: str) -> float:
    """The step of an arm; 0 where its joints are not those of the neighbour."""
    if one is None or other is None or arm not in one or arm not in other:
        return 0.0
    if one[arm].shape != other[arm].shape:
        return 0.0
    steps = other[arm] - one[arm]
    return float(np.abs(steps - math.tau * np.round(steps / math.tau)).max(initial=0.0))
