"""Several tasks of one cell, which one placement of bases and grasps is to serve."""

from __future__ import annotations

from copose.problem.objects import Oriented
from copose.problem.values import Direction, Name, Number, Pair, Positive, Spec, Triple


class CaseSpec(Spec):
    """``[[cases]]``: what differs from ``[object]`` and ``[objective]``, and how much it counts."""

    name: Name
    direction: Direction | None = None
    mass: Positive | None = None
    weight: Positive = 1.0


class Case(CaseSpec, Oriented):
    """A case in space; what it leaves out of a pose is ``[object]``'s."""

    position: Triple | None = None


class PlanarCase(CaseSpec):
    """A case in the plane."""

    position: Pair | None = None
    angle: Number | None = None
