"""What can be maximised, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from copose.capability import Ellipsoid, log_ball_volume, log_det


@dataclass(frozen=True)
class Objective:
    """A measure of a posture, larger is better.

    Attributes:
        kind: as written in a problem file.
        unit: of its value.
        expression: from the system's Gram matrix, (m, m), to the value.
        value: the same of a measured ellipsoid, with all its digits.
    """

    kind: str
    unit: str
    expression: Callable[[ca.SX], ca.SX]
    value: Callable[[Ellipsoid], float]


def _log_volume(gram: ca.SX) -> ca.SX:
    return log_ball_volume(gram.shape[0]) - log_det(gram) / 2


OBJECTIVES: dict[str, Objective] = {
    objective.kind: objective
    for objective in (
        Objective("volume", "log", _log_volume, lambda ellipsoid: ellipsoid.log_volume),
    )
}
