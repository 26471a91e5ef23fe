"""Bodies that are kept apart: rows of programs from witness points, and what is told of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.collision import Bodies, Carrier, Witness, configurations
from copose.constraints.constraint import Constraint
from copose.measurement.meter import Measurement
from copose.mechanics import System
from copose.mechanics.chain import Frame
from copose.poses import Array, Indices, Pose
from copose.results import CollisionRecord

# What programs keep beyond the clearance, m, for a row is exact to first order only; what then
# counts as touching; and what they keep where the row's points are witnesses of where they end.
SPARE = 5e-6
TOUCHING = 3 * SPARE
EXACT = 1e-8
# Rows of a program at least; of the same two carriers, at first.
ROWS = 8
_OF_TWO = 2
# Postures that are measured to tell what is in the way.
_MEASURED = 64
# Nearest misses that differ by less are one, m.
_ALIKE = 1e-6
# Postures that have to share the nearest miss for it to depend on no joint.
_MANY = 8


@dataclass(frozen=True)
class Blocked:
    """What comes too near in postures.

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
    def of(cls, bodies: Bodies, cuts: Sequence[Sequence[Witness]]) -> Apart | None:
        """Room for the witnesses of every posture; None where there are none."""
        most, rows = max(map(len, cuts), default=0), ROWS
        while rows < most:
            rows *= 2
        return cls(bodies.carriers, rows) if most else None

    @property
    def numbers(self) -> int:
        """How many parameters there are."""
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

    def constraints(self, system: System, numbers: ca.SX) -> list[Constraint]:
        """The rows, m, at least zero."""
        frames = [_frame(system, carrier) for carrier in self.carriers]
        entries = ca.vertcat(*(ca.vertcat(ca.vec(f.rotation), f.position) for f in frames))
        table = ca.reshape(numbers, -1, self.rows)
        rows = ca.mtimes(table[:-1, :].T, entries) - table[-1, :].T
        return [Constraint("clearance", rows, np.zeros(self.rows), np.full(self.rows, np.inf), "m")]


def of_two(witnesses: Sequence[Witness]) -> tuple[Witness, ...]:
    """The nearest few of the witnesses of the same two carriers."""
    kept: list[Witness] = []
    many: Counter[tuple[Carrier, Carrier]] = Counter()
    for each in sorted(witnesses, key=lambda each: each.distance):
        if many[each.first, each.second] < _OF_TWO:
            many[each.first, each.second] += 1
            kept.append(each)
    return tuple(kept)


def rows_of(bodies: Bodies, cuts: Sequence[Witness], x: Array) -> Array:
    """What the rows of witnesses, n·(b − a), are in a configuration, (size,), m."""
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
    """Whether rows stop a program at a configuration, (size,), whose bodies do not.

    Args:
        bodies: what is measured.
        cuts: witnesses whose rows it keeps.
        x: where it has ended.
        touching: witnesses there.
    """
    touched = {each.pair for each in touching}
    stop = rows_of(bodies, cuts, x) < bodies.clearance + 2 * SPARE
    return any(cut.pair not in touched for cut, stops in zip(cuts, stop, strict=True) if stops)


def configurations_of(cell: Cell, q: Sequence[Array | None]) -> Array:
    """Where everything is at postures, by arm (count, n_i), or (n_i,); an arm that is None is in
    none of the pairs that are asked for then.
    """
    return configurations(cell.arms, [arm.base for arm in cell.arms], q, cell.problem.object.pose)


def in_the_way(bodies: Bodies, x: Array, pairs: Indices, *, every: bool) -> Blocked:
    """What is too near in every configuration, (count, size): the pair that stops the best.

    Args:
        bodies: what is measured.
        x: the configurations; of many only some are measured.
        pairs: those that count.
        every: whether there are no other configurations; all are measured then.
    """
    measured = x if every else x[:: max(1, -(-len(x) // _MEASURED))]
    found = [each for each in (bodies.nearest(row, pairs) for row in measured) if each is not None]
    best = max(found, key=lambda each: each.distance)
    alike = [e for e in found if e.pair == best.pair and e.distance >= best.distance - _ALIKE]
    a, b = best.pair
    missing = bodies.clearance - max(best.distance, 0.0)
    how = "overlap" if best.distance <= 0 else f"are {missing:.3g} m too near"
    sure = every or len(alike) >= _MANY
    return Blocked(f"{a} and {b} {how}, {'whatever the posture' if sure else 'at best'}", sure)


def with_collision(cell: Cell, measured: Measurement, bodies: Bodies) -> Measurement:
    """A measured posture with its smallest distance."""
    joints = [np.array(q) for q in measured.posture.joints.values()]
    x = configurations_of(cell, joints)[0]
    nearest, notes = bodies.nearest(x), measured.notes
    if nearest is None:
        return measured
    record = CollisionRecord(distance=nearest.distance, pair=nearest.pair)
    if nearest.distance < bodies.clearance:
        both = " and ".join(nearest.pair)
        notes += (
            f"{both} overlap; the clearance is {bodies.clearance:g} m"
            if nearest.distance <= 0
            else f"{both} are nearer than the clearance, {bodies.clearance:g} m: "
            "[constraints] clearance sets it",
        )
    posture = measured.posture.model_copy(update={"collision": record})
    return replace(measured, posture=posture, notes=notes)


def overlap_notes(cell: Cell, bodies: Bodies, joints: Sequence[Array]) -> tuple[str, ...]:
    """A note where bodies overlap at a posture, by arm (n_i,), that nothing keeps apart."""
    pair = bodies.overlapping(configurations_of(cell, joints)[0])
    if pair is None:
        return ()
    return (f"{pair[0]} and {pair[1]} overlap; [constraints] collision = true keeps them apart",)


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
