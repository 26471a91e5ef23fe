"""How near bodies come, by capsules: of many postures at once, and as constraints of a program."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from copose.collision import Carrier, Placements, Scene, carrier_poses
from copose.kernels import Kernel
from copose.mechanics import System
from copose.mechanics.chain import Frame
from copose.mechanics.segments import squared_distance
from copose.planning.cell import Cell
from copose.planning.constraints import Constraint
from copose.planning.measuring import Measurement
from copose.poses import Array, Indices, Mask, Pose
from copose.progress import heed
from copose.results import CollisionRecord, Matrix, matrix
from copose.robots import finite_range

# What is kept beyond the clearance, m: coal tells distances to 1e-6.
_SPARE = 2e-6
# Numbers of a pair of capsules in a program: four ends, and the square of what they keep apart.
_SLOT = 13
# Links with at most so many joints between them are calibrated where their capsules are too near in
# more than such a part of so many random postures; and what is kept beyond what these tell, m.
_FEW_JOINTS, _OFTEN, _POSTURES, _SEED, _CALIBRATED = 3, 0.25, 64, 0, 5e-4
# Postures by which a pair is calibrated, about.
_LOOSENED = 24
# What programs keep more than that, for distances of bodies have some noise, m.
_NOISE = 5e-6
# By how much too loose a calibration is taken back.
_CAUTION = 1.8
# Pairs of capsules of two carriers that a program has room for, at most.
_ROOM = 2
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


@dataclass(frozen=True, eq=False)
class Near:
    """Pairs of capsules that are near each other.

    Attributes:
        rows: of which posture, (k,).
        first: capsules, (k,); ``second`` alike.
        spare: how much farther apart they are than they must be, m, (k,).
        met: the first so many are such as a program has run into, and must keep apart.
    """

    rows: Indices
    first: Indices
    second: Indices
    spare: Array
    met: int = 0

    def joined(self, other: Near) -> Near:
        """With pairs, those first, that a program from the same posture has run into."""
        known = set(zip(other.first.tolist(), other.second.tolist(), strict=True))
        mine = np.array(
            [pair not in known for pair in zip(self.first, self.second, strict=True)], dtype=bool
        )
        return Near(
            np.zeros(len(other.rows) + int(mine.sum()), dtype=np.intp),
            np.concatenate([other.first, self.first[mine]]),
            np.concatenate([other.second, self.second[mine]]),
            np.concatenate([other.spare, self.spare[mine]]),
            len(other.rows) + int(mine[: self.met].sum()),
        )


@dataclass(frozen=True, eq=False)
class Bodies:
    """Where bodies are at several postures.

    Attributes:
        points: ends of all capsules in the world, (count, c, 2, 3).
        centres: of a ball around each body, (count, s, 3).
    """

    points: Array
    centres: Array


NOTHING_NEAR = Near(*(np.zeros(0, dtype=np.intp),) * 3, np.zeros(0))


@dataclass(frozen=True)
class Slot:
    """Room in a program for so many pairs of capsules that two carriers move."""

    first: Carrier
    second: Carrier
    count: int


class Clearance:
    """Distances of all bodies of a cell that may not touch, in any posture; built once.

    Attributes:
        scene: the bodies.
        kernels: compute where an arm's capsules are.
        slack: by how much the capsules of a tested pair may be nearer than its bodies, m, (p,).
    """

    def __init__(self, cell: Cell, scene: Scene) -> None:
        """Write down what is evaluated."""
        self.scene = scene
        self._clearance = cell.problem.constraints.clearance + _SPARE
        self._arms = len(cell.arms)
        self.slack = np.zeros(len(scene.pairs))
        owner, ends, radii = [], [], []
        for k, solid in enumerate(scene.solids):
            for capsule in solid.capsules:
                owner.append(k)
                ends.append([capsule.a, capsule.b])
                radii.append(capsule.radius)
        self._owner = np.array(owner, dtype=np.intp)
        self._ends, self._radii = np.reshape(ends, (-1, 2, 3)), np.array(radii)
        count = len(scene.solids)
        self._of = [np.flatnonzero(self._owner == k) for k in range(count)]
        # One ball around the capsules of every solid.
        self._centres, self._reach = np.zeros((count, 3)), np.full(count, -np.inf)
        for k, mine in enumerate(self._of):
            if len(mine):
                points, r = self._ends[mine].reshape(-1, 3), np.repeat(self._radii[mine], 2)
                centre = ((points - r[:, None]).min(axis=0) + (points + r[:, None]).max(axis=0)) / 2
                self._centres[k] = centre
                self._reach[k] = (np.linalg.norm(points - centre, axis=1) + r).max()
        carriers = [solid.carrier for solid in scene.solids]
        self._solids = [
            np.array([k for k, c in enumerate(carriers) if c.kind == "joint" and c.arm == i], int)
            for i in range(self._arms)
        ]
        self._capsules = [
            np.concatenate([np.zeros(0, dtype=np.intp), *(self._of[k] for k in mine)])
            for mine in self._solids
        ]
        moved = [carriers[k] for k in range(count)]
        arms = np.array([c.arm if c.kind == "joint" else -1 for c in moved], dtype=int)
        self._pair_arms = arms[scene.pairs]
        expressions = [self._expression(cell.system, i) for i in range(self._arms)]
        self._kernels = [
            Kernel(cell.system.arms[i].q, ca.SX(0, 1), points)
            for i, points in enumerate(expressions)
        ]
        segments = ca.SX.sym("segments", 12)
        apart = squared_distance(*ca.vertsplit(segments, 3))
        self._apart = Kernel(segments, ca.SX(0, 1), ca.sqrt(apart))
        # Pairs of capsules, by the carriers that move them, that programs have room for.
        self._room: dict[tuple[Carrier, Carrier], int] = {}
        # What copies share.
        self._pair_of = _table(scene.pairs, count)
        self._capsule_pairs = self._listed()
        self._calibrate(cell)

    def fresh(self) -> Clearance:
        """The same for a search of its own, which no other has taught anything."""
        other = self.calibrated_apart()
        other._room = {}
        return other

    def calibrated_apart(self) -> Clearance:
        """The same with a slack of its own; what programs have room for is shared."""
        other = copy(self)
        other.slack = self.slack.copy()
        return other

    def _calibrate(self, cell: Cell) -> None:
        """Let capsules of links near each other on a chain come as near as the links allow.

        Such links are hardly ever farther apart than their capsules stick out, so that these would
        forbid most postures. Few joints move them against each other: random postures tell how
        much farther apart than the capsules the links are at least. What an answer keeps is
        measured on the links themselves.
        """
        carriers = [solid.carrier for solid in self.scene.solids]
        close = np.array(
            [
                carriers[a].kind == carriers[b].kind == "joint"
                and carriers[a].arm == carriers[b].arm
                and abs(carriers[a].joint - carriers[b].joint) <= _FEW_JOINTS
                for a, b in self.scene.pairs
            ],
            dtype=bool,
        )
        if not close.any():
            return
        rng = np.random.default_rng(_SEED)
        drawn = [
            rng.uniform(*finite_range(arm.lower, arm.upper), (_POSTURES, arm.n))
            for arm in cell.arms
        ]
        self.loosen(cell, drawn, np.flatnonzero(close))

    @property
    def kernels(self) -> tuple[Kernel, ...]:
        """Everything that may be compiled."""
        return (*self._kernels, self._apart)

    def _expression(self, system: System, i: int) -> ca.SX:
        """Points of arm i in its root frame: centres of its solids' balls, then capsules' ends."""
        frames, points = system.arms[i].chain.frames, []
        for k in self._solids[i]:
            points.append(_point(frames[self.scene.solids[k].carrier.joint], self._centres[k]))
        for k in self._solids[i]:
            frame = frames[self.scene.solids[k].carrier.joint]
            for c in self._of[k]:
                points += [_point(frame, end) for end in self._ends[c]]
        return ca.vertcat(*points)

    def own(self, i: int) -> Indices:
        """Tested pairs that only arm i moves against each other, or against what stands still."""
        mine = (self._pair_arms == i) | (self._pair_arms == -1)
        return np.flatnonzero(mine.all(axis=1) & (self._pair_arms == i).any(axis=1))

    @cached_property
    def shared(self) -> Indices:
        """Tested pairs of solids of two arms."""
        return np.flatnonzero(
            (self._pair_arms >= 0).all(axis=1) & (self._pair_arms[:, 0] != self._pair_arms[:, 1])
        )

    @cached_property
    def still(self) -> Indices:
        """Tested pairs that no joint moves."""
        return np.flatnonzero((self._pair_arms < 0).all(axis=1))

    @cached_property
    def every(self) -> Indices:
        """All tested pairs."""
        return np.arange(len(self.scene.pairs))

    def clear(self, cell: Cell, q: Sequence[Array | None], pairs: Indices) -> Mask:
        """Which postures keep the clearance in some tested pairs, (count,).

        Args:
            cell: with everything where it is.
            q: by arm, (count, n_i); None for an arm that these pairs leave out.
            pairs: numbers of them.
        """
        count = next((len(mine) for mine in q if mine is not None), 1)
        clear = np.ones(count, dtype=bool)
        clear[self.near(cell, q, pairs, 0.0).rows] = False
        return clear

    def exactly(self, cell: Cell, q: Sequence[Array | None], pairs: Indices | None = None) -> bool:
        """Whether a posture, by arm (1, n_i), keeps the clearance in some tested pairs, or in all.

        Bodies are measured where their capsules are too near. An arm that is None is in none of
        the pairs.
        """
        some = self.every if pairs is None else pairs
        near = self.near(cell, q, some, 0.0, calibrated=False)
        if not len(near.rows):
            return True
        where = carrier_poses_of(
            cell,
            [np.zeros(arm.n) if mine is None else mine[0]
             for arm, mine in zip(cell.arms, q, strict=True)],
        )  # fmt: skip
        distances = self.scene.distances
        which = np.unique(self._pair_of[self._owner[near.first], self._owner[near.second]])
        return not set(which.tolist()) & distances.enclosed(where) and all(
            distances.exact(int(pair), where) >= self._clearance for pair in which
        )

    def calibrate(
        self, cell: Cell, q: Sequence[Array], within: float, *, cautious: bool = False
    ) -> None:
        """Let capsules be as near at a posture, by arm (1, n_i), as their bodies may be.

        Args:
            cell: with everything where it is.
            q: the posture.
            within: m; of pairs that are less farther apart than they must be.
            cautious: whether more is taken back than the posture tells: where a program ended too
                near, the next end is likely to differ again, by a part of that.
        """
        near = self.near(cell, q, self.every, within)
        where = carrier_poses_of(cell, [mine[0] for mine in q])
        pairs = self._pair_of[self._owner[near.first], self._owner[near.second]]
        for pair in np.unique(pairs):
            exact = self.scene.distances.exact(int(pair), where)
            # What is left of the distance, or missing, that capsules do not know of.
            more = exact - self._clearance - _NOISE - near.spare[pairs == pair].min()
            if exact > 0 and abs(more) > _NOISE / 2:
                self.slack[pair] += _CAUTION * more if cautious and more < 0 else more

    def loosen(self, cell: Cell, q: Sequence[Array | None], pairs: Indices) -> None:
        """Calibrate capsules of pairs that stop most of many postures, by arm (count, n_i), by the
        bodies in some of these.
        """
        near = self.near(cell, q, pairs, 0.0)
        count = next((len(mine) for mine in q if mine is not None), 1)
        which = self._pair_of[self._owner[near.first], self._owner[near.second]]
        for pair in np.unique(which):
            rows = np.unique(near.rows[which == pair])
            if len(rows) < _OFTEN * count:
                continue
            excess = []
            for row in rows[:: max(1, len(rows) // _LOOSENED)]:
                joints = [np.zeros(arm.n) if mine is None else mine[row]
                          for arm, mine in zip(cell.arms, q, strict=True)]  # fmt: skip
                exact = self.scene.distances.exact(int(pair), carrier_poses_of(cell, joints))
                spare = near.spare[(which == pair) & (near.rows == row)].min()
                if exact > 0:
                    excess.append(exact - self._clearance - spare)
            more = min(excess, default=0.0) - _CALIBRATED
            self.slack[pair] += max(more, 0.0)

    def near(
        self,
        cell: Cell,
        q: Sequence[Array | None],
        pairs: Indices,
        within: float,
        *,
        calibrated: bool = True,
    ) -> Near:
        """Pairs of capsules that are less farther apart than they must be than ``within``, m.

        Args:
            cell: with everything where it is.
            q: by arm, (count, n_i); None for an arm that these pairs leave out.
            pairs: numbers of tested pairs.
            within: m.
            calibrated: whether capsules may be nearer than bodies where these tell so.
        """
        return self.among(self.placed(cell, q), pairs, within, calibrated=calibrated)

    def among(
        self, bodies: Bodies, pairs: Indices, within: float, *, calibrated: bool = True
    ) -> Near:
        """`near` of bodies that are placed."""
        a, b = self.scene.pairs[pairs].T
        centres = bodies.centres
        gaps = np.linalg.norm(centres[:, a] - centres[:, b], axis=2)
        wanted = self._clearance - self.slack[pairs] * calibrated
        rows, which = np.nonzero(gaps < self._reach[a] + self._reach[b] + wanted + within)
        # Capsule by capsule where the balls are near.
        first, second, starts = self._capsule_pairs
        counts = np.diff(starts)[pairs[which]]
        ahead = np.concatenate([[0], np.cumsum(counts)])
        each = np.repeat(starts[pairs[which]] - ahead[:-1], counts) + np.arange(ahead[-1])
        first, second, row = first[each], second[each], np.repeat(rows, counts)
        segments = np.empty((len(row), 12))
        segments[:, :6] = bodies.points[row, first].reshape(-1, 6)
        segments[:, 6:] = bodies.points[row, second].reshape(-1, 6)
        spare = self._apart(segments, np.zeros(0))[:, 0] if len(row) else np.zeros(0)
        spare -= self._radii[first] + self._radii[second] + np.repeat(wanted[which], counts)
        close = np.flatnonzero(spare < within)
        return Near(row[close], first[close], second[close], spare[close])

    def _listed(self) -> tuple[Indices, Indices, Indices]:
        """Capsules of all tested pairs, one pair after the other, and where each begins."""
        of = self._of
        first = [np.repeat(of[a], len(of[b])) for a, b in self.scene.pairs]
        second = [np.tile(of[b], len(of[a])) for a, b in self.scene.pairs]
        none = [np.zeros(0, dtype=np.intp)]
        starts = np.cumsum([0, *(len(some) for some in first)])
        return np.concatenate(none + first), np.concatenate(none + second), starts

    def keep_apart(self, alone: Sequence[Bodies], chosen: Indices) -> Mask:
        """Which combinations of the arms' own postures keep the arms clear of each other.

        Args:
            alone: where the bodies of each arm are at its postures.
            chosen: numbers of these, (count, K).
        """
        clear = np.ones(len(chosen), dtype=bool)
        first, second, starts = self._capsule_pairs
        for pair in self.shared:
            heed()
            (a, b), (i, j) = self.scene.pairs[pair], self._pair_arms[pair]
            rows = np.flatnonzero(clear)
            here, there = chosen[rows, i], chosen[rows, j]
            gaps = np.linalg.norm(alone[i].centres[here, a] - alone[j].centres[there, b], axis=1)
            wanted = self._clearance - self.slack[pair]
            rows = rows[gaps < self._reach[a] + self._reach[b] + wanted]
            for each in range(starts[pair], starts[pair + 1]):
                rows = rows[clear[rows]]
                one, other = first[each], second[each]
                segments = np.empty((len(rows), 12))
                segments[:, :6] = alone[i].points[chosen[rows, i], one].reshape(-1, 6)
                segments[:, 6:] = alone[j].points[chosen[rows, j], other].reshape(-1, 6)
                if len(rows):
                    least = self._radii[one] + self._radii[other] + wanted
                    clear[rows] = self._apart(segments, np.zeros(0))[:, 0] >= least
        return clear

    def placed(self, cell: Cell, q: Sequence[Array | None]) -> Bodies:
        """Where bodies are at postures, by arm (count, n_i); of an arm that is None, nowhere."""
        count = next((len(mine) for mine in q if mine is not None), 1)
        points = np.full((count, *self._ends.shape), np.inf)
        centres = np.full((count, *self._centres.shape), np.inf)
        for k, solid in enumerate(self.scene.solids):
            if solid.carrier.kind == "joint":
                continue
            pose = _still(cell, solid.carrier)
            points[:, self._of[k]] = self._ends[self._of[k]] @ pose.rotation.T + pose.position
            centres[:, k] = pose.rotation @ self._centres[k] + pose.position
        for i, mine in enumerate(q):
            if mine is None or not len(self._solids[i]):
                continue
            base = cell.arms[i].base
            found = self._kernels[i](mine, np.zeros(0)).reshape(len(mine), -1, 3)
            found = found @ base.rotation.T + base.position
            solids = self._solids[i]
            centres[:, solids] = found[:, : len(solids)]
            points[:, self._capsules[i]] = found[:, len(solids) :].reshape(len(mine), -1, 2, 3)
        return Bodies(points, centres)

    def in_the_way(
        self, cell: Cell, q: Sequence[Array | None], near: Near, most: int, *, every: bool
    ) -> Blocked:
        """What is too near in every posture, by arm (count, n_i): the pair that stops the best.

        Args:
            cell: with everything where it is.
            q: the postures; an arm that is None is in no pair.
            near: pairs of capsules that are too near.
            most: postures whose bodies are measured, those whose capsules are the least too near.
            every: whether there are no other postures.
        """
        rows = np.unique(near.rows)
        least = np.array([near.spare[near.rows == row].min() for row in rows])
        found: list[tuple[float, int]] = []
        for row in rows[np.argsort(-least, kind="stable")[:most]]:
            mine = near.rows == row
            pairs = np.unique(self._pair_of[self._owner[near.first[mine]],
                                            self._owner[near.second[mine]]])  # fmt: skip
            where = carrier_poses_of(
                cell,
                [np.zeros(arm.n) if some is None else some[row]
                 for arm, some in zip(cell.arms, q, strict=True)],
            )  # fmt: skip
            inside = self.scene.distances.enclosed(where)
            found.append(min(
                (0.0 if pair in inside else self.scene.distances.exact(int(pair), where), int(pair))
                for pair in pairs
            ))  # fmt: skip
        distance, pair = max(found)
        alike = [d for d, other in found if other == pair and d >= distance - _ALIKE]
        count = next((len(some) for some in q if some is not None), 1)
        judged = every and len(found) == count and distance < cell.problem.constraints.clearance
        a, b = (self.scene.solids[k].name for k in self.scene.pairs[pair])
        missing = cell.problem.constraints.clearance - max(distance, 0.0)
        how = "overlap" if distance <= 0 else f"are {missing:.3g} m too near"
        return Blocked(f"{a} and {b} {how}, at best", judged or len(alike) >= _MANY)

    def drawn(self, cell: Cell, joints: Sequence[Array]) -> dict[str, Matrix]:
        """Capsules of the arms, two ends in the world and a radius each, by arm."""
        points = self.placed(cell, [q[None] for q in joints]).points
        found: dict[str, Matrix] = {}
        for i, arm in enumerate(cell.arms):
            moved = [k for k, solid in enumerate(self.scene.solids) if solid.carrier.arm == i]
            mine = np.concatenate([np.zeros(0, dtype=np.intp), *(self._of[k] for k in moved)])
            if len(mine):
                ends = points[0, mine].reshape(-1, 6)
                found[arm.name] = matrix(np.column_stack([ends, self._radii[mine]]))
        return found

    def _needed(self, near: Near) -> list[tuple[Carrier, Carrier]]:
        """Which carriers move the pairs of capsules."""
        carriers = [solid.carrier for solid in self.scene.solids]
        return [
            (carriers[self._owner[a]], carriers[self._owner[b]])
            for a, b in zip(near.first, near.second, strict=True)
        ]

    def numbers(self, slots: Sequence[Slot], near: Near) -> Array:
        """Capsules for the slots of a program, the nearest of each; the rest of them stay empty."""
        needed = self._needed(near)
        rest = near.met + np.argsort(near.spare[near.met :], kind="stable")
        order = [*range(near.met), *rest.tolist()]
        numbers = []
        for slot in slots:
            mine = [k for k in order if needed[k] == (slot.first, slot.second)][: slot.count]
            for k in mine:
                a, b = near.first[k], near.second[k]
                pair = self._pair_of[self._owner[a], self._owner[b]]
                apart = self._radii[a] + self._radii[b] + self._clearance - self.slack[pair]
                square = max(apart, 0.0) ** 2
                numbers.append([*self._ends[a].ravel(), *self._ends[b].ravel(), square])
            # Nothing is nearer than this.
            empty = [*np.zeros(3), 1.0, 0, 0, 0, 0, 1.0, 0, 1.0, 1.0, -1.0]
            numbers += [empty] * (slot.count - len(mine))
        return np.array(numbers).ravel()

    def slots(self, near: Sequence[Near]) -> tuple[Slot, ...]:
        """Room for the pairs of capsules of every posture, as many as the fullest needs, and for
        all before: a program that has more than it needs is not built anew.
        """
        counts = self._room
        for each in near:
            mine = self._needed(each)
            for pair in set(mine):
                needed = max(min(_ROOM, mine.count(pair)), mine[: each.met].count(pair))
                counts[pair] = max(counts.get(pair, 0), needed)
        order = sorted(counts, key=lambda pair: (_order(pair[0]), _order(pair[1])))
        return tuple(Slot(*pair, counts[pair]) for pair in order)


def _table(pairs: Indices, count: int) -> Indices:
    """Number of the tested pair of two solids, (s, s), −1 where they are none."""
    table = np.full((count, count), -1, dtype=np.intp)
    a, b = pairs.T
    table[a, b] = table[b, a] = np.arange(len(a))
    return table


@dataclass(frozen=True)
class Apart:
    """Pairs of capsules that a program keeps apart; which they are is its parameters."""

    slots: tuple[Slot, ...]

    @property
    def numbers(self) -> int:
        """How many parameters there are."""
        return _SLOT * sum(slot.count for slot in self.slots)

    def constraints(self, system: System, numbers: ca.SX) -> list[Constraint]:
        """Squares of distances less squares of what must be kept, m², at least zero."""
        found = []
        parts = iter(ca.vertsplit(numbers, _SLOT)) if numbers.numel() else iter(())
        for slot in self.slots:
            frames = [_frame(system, carrier) for carrier in (slot.first, slot.second)]
            rows = []
            for _ in range(slot.count):
                *ends, square = ca.vertsplit(next(parts), [0, 3, 6, 9, 12, 13])
                placed = [_placed(frames[k // 2], end) for k, end in enumerate(ends)]
                rows.append(squared_distance(*placed) - square)
            name = f"clearance of {_name(system, slot.first)} and {_name(system, slot.second)}"
            some = ca.vertcat(*rows)
            found.append(
                Constraint(name, some, np.zeros(slot.count), np.full(slot.count, np.inf), "m²")
            )
        return found


def with_collision(cell: Cell, measured: Measurement, clearance: Clearance) -> Measurement:
    """A measured posture with its smallest distance and its capsules."""
    joints = [np.array(q) for q in measured.posture.joints.values()]
    keys: dict[str, Any] = {"capsules": clearance.drawn(cell, joints)}
    nearest = clearance.scene.nearest(carrier_poses_of(cell, joints))
    notes = measured.notes
    if nearest is not None:
        keys["collision"] = CollisionRecord(distance=nearest.distance, pair=nearest.pair)
        least = cell.problem.constraints.clearance
        if nearest.distance < least:
            notes += (f"{' and '.join(nearest.pair)} are nearer than the clearance, {least:g} m",)
    posture = measured.posture.model_copy(update=keys)
    return replace(measured, posture=posture, notes=notes)


def overlap_notes(cell: Cell, scene: Scene, joints: Sequence[Array]) -> tuple[str, ...]:
    """A note where bodies overlap at a posture, by arm (n_i,), that nothing keeps apart."""
    pair = scene.overlapping(carrier_poses_of(cell, joints))
    if pair is None:
        return ()
    return (f"{pair[0]} and {pair[1]} overlap; [constraints] collision = true keeps them apart",)


def carrier_poses_of(cell: Cell, joints: Sequence[Array]) -> Placements:
    """Where everything is at a posture, by arm (n_i,)."""
    bases = [arm.base for arm in cell.arms]
    return carrier_poses(cell.arms, bases, joints, cell.problem.object.pose)


def _order(carrier: Carrier) -> tuple[str, int, int]:
    return carrier.kind, carrier.arm, carrier.joint


def _point(frame: Frame, point: Array) -> ca.SX:
    return frame.position + frame.rotation @ ca.DM(point)


def _placed(frame: Frame, point: ca.SX) -> ca.SX:
    return frame.position + frame.rotation @ point


def _still(cell: Cell, carrier: Carrier) -> Pose:
    """Where a carrier is that no joint moves."""
    if carrier.kind == "object":
        return cell.problem.object.pose
    return cell.arms[carrier.arm].base if carrier.kind == "root" else Pose.from_rpy()


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


def _name(system: System, carrier: Carrier) -> str:
    if carrier.arm < 0:
        return carrier.kind
    arm = system.arms[carrier.arm].arm
    return f"{arm.name}/{arm.joint_names[carrier.joint] if carrier.joint >= 0 else 'root'}"
