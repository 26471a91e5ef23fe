"""Slices of ellipsoids that can be drawn at the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.capability import Ellipsoid
from copose.poses import Array
from copose.problem import SPACES
from copose.report.words import ANGULAR_AXES, LINEAR_AXES
from copose.results import EllipsoidRecord, Solution


@dataclass(frozen=True, eq=False)
class Slice:
    """The slice of an ellipsoid in which all linear, or all angular, accelerations are zero."""

    ellipsoid: Ellipsoid  # the slice in the d coordinates that are left
    world: tuple[int, ...]  # the world axis that each of them is along, or about

    @property
    def surface(self) -> Array:
        """Points of the surface about its centre: a segment's ends (2, 3), a closed curve (k, 3),
        or a grid of longitudes and latitudes (k, l, 3).
        """
        around, down = np.linspace(0, 2 * np.pi, 181), np.linspace(0, np.pi, 17)
        if len(self.world) == 1:
            unit = np.array([[1.0], [-1.0]])
        elif len(self.world) == 2:
            unit = np.column_stack([np.cos(around), np.sin(around)])
        else:
            around = around[::5]
            flat = np.ones_like(around)
            unit = np.stack(
                [
                    np.outer(np.cos(around), np.sin(down)),
                    np.outer(np.sin(around), np.sin(down)),
                    np.outer(flat, np.cos(down)),
                ],
                axis=-1,
            )
        points = np.zeros((*unit.shape[:-1], 3))
        points[..., list(self.world)] = self.ellipsoid.boundary(unit) - self.ellipsoid.center
        return points


def linear_slice(record: EllipsoidRecord, names: Sequence[str]) -> Slice | None:
    """The slice of pure linear accelerations of an ellipsoid in the named coordinates."""
    return _slice(record, names, LINEAR_AXES)


def angular_slice(record: EllipsoidRecord, names: Sequence[str]) -> Slice | None:
    """The slice of pure angular accelerations."""
    return _slice(record, names, ANGULAR_AXES)


def _slice(record: EllipsoidRecord, names: Sequence[str], world: dict[str, int]) -> Slice | None:
    """The slice of an ellipsoid along some of the named coordinates; None where there are none."""
    rows = [i for i, name in enumerate(names) if name in world]
    ellipsoid = record.value
    if ellipsoid is None or not rows:
        return None
    return Slice(ellipsoid.sliced(rows), tuple(world[names[i]] for i in rows))


def all_coordinates(solution: Solution) -> tuple[str, ...]:
    """The coordinates of the task space, which the arms' own ellipsoids have."""
    return SPACES[solution.problem.space].coordinates
