"""Clearance of bodies: rows of programs from witness points, and what is in the way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.collision import Bodies, Carrier, Witness, configurations
from copose.constraints.constraint import Constraint, ConstraintTerm
from copose.mechanics import System
from copose.mechanics.chain import Frame
from copose.poses import Array, Indices, Pose

# What programs keep beyond the clearance, m: a row is exact to first order only.
SPARE = 5e-6


@dataclass(frozen=True)
class Blocked:
    """An obstruction: bodies that come too near in postures.

    Attributes:
        reason: a sentence.
        sure: whether there are no others, or the nearest miss is the same in many: what stops it
            does not depend on the joints.
    """

    reason: str
    sure: bool


@dataclass(frozen=True)
class Apart:
    """Rows of a program that keep witness points apart; which points they are is its parameters.

    A row n·(b − a) − c ≥ 0, with a and b fixed to carriers and n to the world, is linear in the
    carriers' frames, so that any two carriers fit any row, and one program serves all.

    Attributes:
        carriers: of bodies.
        rows: how many.
    """

    carriers: tuple[Carrier, ...]
    rows: int

    @classmethod
    def of(cls, bodies: Bodies, cuts: Sequence[Sequence[Witness]], fewest: int = 8) -> Apart | None:
        """Room for the witnesses of every posture; None where there are none.

        There are at least the ``fewest`` rows, so that few programs are built.
        """
        most, rows = max(map(len, cuts), default=0), fewest
        while rows < most:
            rows *= 2
        return cls(bodies.carriers, rows) if most else None

    @property
    def numbers(self) -> int:
        """The number of parameters."""
        return self.rows * (12 * len(self.carriers) + 1)

    def given(self, bodies: Bodies, cuts: Sequence[Witness], margin: float = 0.0) -> Array:
        """The parameters for witnesses that keep so much more than the clearance, m; rows that are
        left over are always kept.
        """
        table = np.zeros((self.rows, 12 * len(self.carriers) + 1))
        table[:, -1] = -1.0
        number = {carrier: 12 * k for k, carrier in enumerate(self.carriers)}
        for row, cut in zip(table, cuts, strict=False):
            for sign, carrier, point in ((-1.0, cut.first, cut.a), (1.0, cut.second, cut.b)):
                k = number[carrier]
                row[k : k + 9] += sign * np.outer(point, cut.normal).ravel()
                row[k + 9 : k + 12] += sign * cut.normal
            row[-1] = bodies.clearance + margin + SPARE
        return table.ravel()

    def term(self, system: System) -> ConstraintTerm:
        """The rows, m, at least zero."""
        numbers = ca.SX.sym("witnesses", self.numbers)
        frames = [_frame(system, carrier) for carrier in self.carriers]
        entries = ca.vertcat(*(ca.vertcat(ca.vec(f.rotation), f.position) for f in frames))
        table = ca.reshape(numbers, -1, self.rows)
        rows = ca.mtimes(table[:-1, :].T, entries) - table[-1, :].T
        zero, endless = np.zeros(self.rows), np.full(self.rows, np.inf)
        above = Constraint("clearance", rows, zero, endless, "m")
        return ConstraintTerm(ca.SX(0, 1), (above,), numbers)


def of_two(witnesses: Sequence[Witness], most: int = 2) -> tuple[Witness, ...]:
    """The nearest few of the witnesses of the same two carriers."""
    kept: list[Witness] = []
    many: Counter[tuple[Carrier, Carrier]] = Counter()
    for witness in sorted(witnesses, key=lambda witness: witness.distance):
        if many[witness.first, witness.second] < most:
            many[witness.first, witness.second] += 1
            kept.append(witness)
    return tuple(kept)


def rows_of(bodies: Bodies, cuts: Sequence[Witness], x: Array) -> Array:
    """The rows of witnesses, n·(b − a), in a configuration, (size,), m."""
    where = bodies.placed(x[None])[0]
    number = {carrier: k for k, carrier in enumerate(bodies.carriers)}
    rows = np.zeros(len(cuts))
    for k, cut in enumerate(cuts):
        i, j = number[cut.first], number[cut.second]
        a = where.rotations[i] @ cut.a + where.positions[i]
        b = where.rotations[j] @ cut.b + where.positions[j]
        rows[k] = cut.normal @ (b - a)
    return rows


def held_back(
    bodies: Bodies, cuts: Sequence[Witness], x: Array, touching: Sequence[Witness]
) -> bool:
    """True where rows stop a program at a configuration, (size,), whose bodies do not: rows of cuts
    of which none is among the witnesses that touch there.
    """
    touched = {witness.pair for witness in touching}
    stop = rows_of(bodies, cuts, x) < bodies.clearance + 2 * SPARE
    return any(cut.pair not in touched for cut, stops in zip(cuts, stop, strict=True) if stops)


def configurations_of(cell: Cell, q: Sequence[Array | None]) -> Array:
    """Configurations of all bodies at postures, by arm (count, n_i), or (n_i,); an arm that is None
    is in none of the pairs that are asked for then.
    """
    return configurations(cell.arms, [arm.base for arm in cell.arms], q, cell.problem.object.pose)


def in_the_way(
    bodies: Bodies, x: Array, pairs: Indices, *, every: bool, measured: int = 64
) -> Blocked:
    """The pair of bodies that is too near in the best of configurations, (count, size).

    Args:
        bodies: what is measured.
        x: the configurations; of many only some are measured.
        pairs: those that count.
        every: whether there are no other configurations; all are measured then.
        measured: how many are, of many.
    """
    rows = x if every else x[:: max(1, -(-len(x) // measured))]
    nearest = [near for near in (bodies.nearest(row, pairs) for row in rows) if near is not None]
    best = max(nearest, key=lambda near: near.distance)
    # Nearest misses that differ by less than 1e-6 m are one; shared by eight postures it depends
    # on no joint.
    alike = [n for n in nearest if n.pair == best.pair and n.distance >= best.distance - 1e-6]
    a, b = best.pair
    missing = bodies.clearance - max(best.distance, 0.0)
    how = "overlap" if best.distance <= 0 else f"are {missing:.3g} m too near"
    sure = every or len(alike) >= 8
    return Blocked(f"{a} and {b} {how}, {'whatever the posture' if sure else 'at best'}", sure)


def _frame(system: System, carrier: Carrier) -> Frame:
    """A carrier in the world."""
    if carrier.kind == "world":
        return Frame.at(Pose.from_rpy())
    if carrier.kind == "object":
        held = system.object
        return Frame(held.position, held.rotation, held.quaternion)
    arm = system.arms[carrier.arm]
    if carrier.kind == "root":
        return arm.base
    inner = arm.chain.frames[carrier.joint]
    return Frame(
        arm.base.position + arm.base.rotation @ inner.position,
        arm.base.rotation @ inner.rotation,
        inner.quaternion,
    )
