"""Expressions of a posture as arrays and ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise

import casadi as ca

from copose.capability import Ellipsoid
from copose.cell.cell import Cell
from copose.kernels import Kernel
from copose.poses import Array


class PostureFunctions:
    """Several expressions of a posture, (n,), and of parameters, as numbers."""

    def __init__(self, q: ca.SX, parameters: ca.SX, parts: Sequence[ca.SX]) -> None:
        """Build the function of them all."""
        self._shapes = [part.shape for part in parts]
        edges = accumulate((part.numel() for part in parts), initial=0)
        self._places = [slice(*ends) for ends in pairwise(edges)]
        together = ca.vertcat(*(ca.vec(ca.densify(part)) for part in parts))
        self._kernel = Kernel(q, parameters, together)

    def __call__(self, q: Array, parameters: Array) -> list[Array]:
        """Each at a posture."""
        values, parts = (
            self._kernel(q[None], parameters)[0],
            zip(self._places, self._shapes, strict=True),
        )
        return [values[place].reshape(shape, order="F") for place, shape in parts]


def ellipsoid_of(factor: Array, center: Array | None = None) -> Ellipsoid | None:
    """The ellipsoid of a factor, or None where it is singular to working precision."""
    try:
        return Ellipsoid.from_factor(factor, center)
    except ValueError:
        return None


def sliced(cell: Cell, ellipsoid: Ellipsoid | None) -> Ellipsoid | None:
    """The slice of an ellipsoid of all coordinates that the problem's axes ask for."""
    axes = cell.problem.axes
    if ellipsoid is None or axes == tuple(range(cell.system.space.m)):
        return ellipsoid
    return ellipsoid.sliced(axes)
