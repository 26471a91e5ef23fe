"""Free coordinates beside the joints, as one vector of offsets, m and rad."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.mechanics import System
from copose.mechanics.chain import multiply_quaternions
from copose.mechanics.held_object import N_PARAMETERS
from copose.poses import Array
from copose.problem import PlanarObject, Problem, displaced
from copose.results import Solution
from copose.robots.reach_bounds import ReachBound


@dataclass(frozen=True)
class Coordinate:
    """One thing that may be moved.

    Attributes:
        what: ``object``, ``base`` or ``grasp``.
        arm: whose base or grasp, None for the object.
        name: ``x``, ``yaw``, …, as in the file.
        lower: least offset; ``upper`` the largest.
    """

    what: str
    arm: int | None
    name: str
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Freedom:
    """The free coordinates x of a problem, (d,): the object's first, then the arms'."""

    coordinates: tuple[Coordinate, ...]

    @classmethod
    def of(cls, problem: Problem) -> Freedom:
        """The coordinates that the tables ``freedom`` of a problem name."""
        coordinates = [
            Coordinate("object", None, _spatial(name), *interval)
            for name, interval in problem.object.freedom.ranges.items()
        ]
        for i, arm in enumerate(problem.arms):
            for what in ("base", "grasp"):
                coordinates += [
                    Coordinate(what, i, name, *interval)
                    for name, interval in getattr(arm.freedom, what).ranges.items()
                ]
        return cls(tuple(coordinates))

    def __len__(self) -> int:
        return len(self.coordinates)

    @cached_property
    def lower(self) -> Array:
        """Least offsets, (d,)."""
        return np.array([c.lower for c in self.coordinates])

    @cached_property
    def upper(self) -> Array:
        """Largest offsets, (d,)."""
        return np.array([c.upper for c in self.coordinates])

    @property
    def nominal(self) -> Array:
        """The file's pose clipped into the ranges, (d,)."""
        return np.clip(np.zeros(len(self)), self.lower, self.upper)

    @property
    def owned(self) -> Array:
        """Indices of the object's coordinates, which every case has for itself."""
        return np.array([k for k, c in enumerate(self.coordinates) if c.arm is None], dtype=int)

    def never_closes(self, cell: Cell, goals: Sequence[Array]) -> bool:
        """True where a bound tells that some arm's links are too short wherever in the ranges
        everything is.

        Args:
            cell: with everything at `nominal`.
            goals: of the tips in root frames there, by arm, position first.
        """
        away = np.maximum(self.upper - self.nominal, self.nominal - self.lower)
        for i, (arm, goal) in enumerate(zip(cell.arms, goals, strict=True)):
            shift = 0.0
            for c, most in zip(self.coordinates, away, strict=True):
                if c.arm not in (None, i):
                    continue
                lever = 1.0
                if c.name in ("roll", "pitch", "yaw"):
                    # A grasp that turns stays where it is; only where the tip points is another.
                    turned = {"object": arm.grasp.position, "base": goal[:3], "grasp": np.zeros(3)}
                    lever = float(np.linalg.norm(turned[c.what]))
                shift += lever * float(most)
            bound = ReachBound.of(arm, cell.lower[i], cell.upper[i])
            if bound.missed(goal, rigid=False) > shift:
                return True
        return False

    def names(self, problem: Problem) -> tuple[str, ...]:
        """The coordinates as a result names them: ``object.x``, ``right.base.yaw``."""
        planar = problem.space.planar
        return tuple(
            f"object.{'angle' if planar and c.name == 'yaw' else c.name}"
            if c.arm is None
            else f"{problem.arms[c.arm].name}.{c.what}.{c.name}"
            for c in self.coordinates
        )

    def stated(self, problem: Problem, solution: Solution, when: str, case: str = "") -> Array:
        """Coordinates that a result states, (d,): before or after, in a case if there are any."""
        known = {record.name: getattr(record, when) for record in solution.freedom}
        x = self.nominal
        for k, name in enumerate(self.names(problem)):
            value = known.get(f"{case}: {name}" if case else name, known.get(name))
            x[k] = x[k] if value is None else value
        return x

    def at(self, cell: Cell, x: Array) -> Cell:
        """The cell with everything moved by x, (d,)."""
        offsets = self._offsets(x)
        problem = displaced(cell.problem, offsets.get(("object", None), {}))
        arms = []
        for i, arm in enumerate(cell.arms):
            base, grasp = offsets.get(("base", i), {}), offsets.get(("grasp", i), {})
            if base:
                arm = replace(arm, base=arm.base.displaced(base, "yaw"))
            if grasp:
                arm = replace(arm, grasp=arm.grasp.displaced(grasp, "twist"))
            arms.append(arm)
        return cell.with_places(problem, tuple(arms))

    def _offsets(self, x: Array) -> dict[tuple[str, int | None], dict[str, float]]:
        offsets: dict[tuple[str, int | None], dict[str, float]] = {}
        for c, value in zip(self.coordinates, x, strict=True):
            offsets.setdefault((c.what, c.arm), {})[c.name] = float(value)
        return offsets

    def numbers(self, cell: Cell) -> Array:
        """Numbers of a cell for `parameters`: its own, and its object's roll, pitch and yaw."""
        thing = cell.problem.object
        rpy = (0.0, 0.0, thing.angle) if isinstance(thing, PlanarObject) else thing.rpy
        return np.concatenate([cell.parameters, rpy])

    def parameters(self, system: System, x: ca.SX, numbers: ca.SX) -> ca.SX:
        """`System.parameters` of the cell whose `numbers` these are, moved by x, (d,)."""
        where = {(c.what, c.arm, c.name): x[k] for k, c in enumerate(self.coordinates)}

        def offset(what: str, arm: int | None, names: Sequence[str]) -> ca.SX:
            return ca.vertcat(*(where.get((what, arm, name), ca.SX(0)) for name in names))

        angles = "roll", "pitch", "yaw"
        given, rpy = numbers[:-3], numbers[-3:] + offset("object", None, angles)
        quaternion = given[3:7]
        if any(("object", None, name) in where for name in angles):
            yaw, pitch, roll = (_about(rpy[k], k) for k in (2, 1, 0))
            quaternion = multiply_quaternions(multiply_quaternions(yaw, pitch), roll)
        parts = [given[:3] + offset("object", None, "xyz"), quaternion, given[7:N_PARAMETERS]]
        first = N_PARAMETERS
        for what in ("base", "grasp"):
            for i, arm in enumerate(system.arms):
                if what not in arm.arm.free:
                    continue
                position, turn = given[first : first + 3], given[first + 3 : first + 7]
                angle = offset(what, i, ["yaw" if what == "base" else "twist"])
                about = _about(angle, 2)
                pair = (about, turn) if what == "base" else (turn, about)
                turned = multiply_quaternions(*pair)
                parts += [position + offset(what, i, "xyz"), turned]
                first += 7
        return ca.vertcat(*parts)


def _spatial(name: str) -> str:
    """The name of a coordinate in space: in the plane the object's angle is its yaw."""
    return "yaw" if name == "angle" else name


def _about(angle: ca.SX, axis: int) -> ca.SX:
    """The quaternion of a turn about a coordinate axis."""
    parts = [ca.cos(angle / 2), ca.SX(0), ca.SX(0), ca.SX(0)]
    parts[1 + axis] = ca.sin(angle / 2)
    return ca.vertcat(*parts)
