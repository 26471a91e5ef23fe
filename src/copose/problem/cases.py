"""Several tasks of one cell, which one placement of bases and grasps is to serve."""

from __future__ import annotations

from copose.problem.fields import Direction, Name, Number, Pair, Positive, Spec, Triple
from copose.problem.objects import Oriented


class CaseSpec(Spec):
    """``[[cases]]``: what differs from ``[object]`` and ``[objective]``, and how much it counts.

    Attributes:
        name: its name, which no other case has.
        direction: direction in place of the objective's; left out, that.
        mass: mass of the object, kg, with inertia in proportion; left out, the object's.
        weight: how much its objective counts.
    """

    name: Name
    direction: Direction | None = None
    mass: Positive | None = None
    weight: Positive = 1.0


class Case(CaseSpec, Oriented):
    """``[[cases]]`` in space; what it leaves out of a pose is ``[object]``'s.

    Attributes:
        position: centre of mass in the world, m; left out, the object's.
    """

    position: Triple | None = None


class PlanarCase(CaseSpec):
    """``[[cases]]`` in the plane.

    Attributes:
        position: centre of mass in the world, m; left out, the object's.
        angle: angle of the object in the world, rad; left out, the object's.
    """

    position: Pair | None = None
    angle: Number | None = None
