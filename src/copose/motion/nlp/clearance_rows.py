"""Clearance constraints of a motion: distances of witness points and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.collision import Bodies, Witness
from copose.constraints.clearance import SPARE
from copose.motion.path.knots import Course
from copose.poses import Array, Indices


class ClearanceRows:
    """Rows n·(b − a) − c ≥ 0 at knots, with a and b fixed to carriers and n to the world.

    With the axis z_l of a joint and the point p it moves, ∂p/∂q_l = z_l × (p − o_l), of a sliding
    one z_l; ∂²p/∂q_l ∂q_m = z_l × ∂p/∂q_m where l comes before m and turns.

    Attributes:
        knots: of each row, (r,).
        moved: which joints move a row, (r, N).
    """

    def __init__(
        self, bodies: Bodies, course: Course, near: Sequence[Sequence[Witness]], margin: float
    ) -> None:
        """Set up the rows of some witnesses.

        Args:
            bodies: that are kept apart.
            course: at the knots.
            near: the witnesses at each.
            margin: what they keep beyond the clearance, m.
        """
        self._bodies, self._course = bodies, course
        arms = course.settings[0].cell.arms
        number = {carrier: i for i, carrier in enumerate(bodies.carriers)}
        joints = [(i, j) for i, arm in enumerate(arms) for j in range(arm.n)]
        self._frames = np.array([
            k for k, carrier in enumerate(bodies.carriers) if carrier.kind == "joint"
        ])  # fmt: skip
        self._axes = np.array([joint.axis for arm in arms for joint in arm.joints])
        self._turns = np.array([joint.kind == "revolute" for arm in arms for joint in arm.joints])
        cuts = [cut for witnesses in near for cut in witnesses]
        self.knots = np.repeat(np.arange(len(near)), [len(witnesses) for witnesses in near])
        self._least = bodies.clearance + margin + SPARE
        # Ends of the rows: first all that are taken off, then all that are added.
        carriers = [cut.first for cut in cuts] + [cut.second for cut in cuts]
        normals = np.reshape([cut.normal for cut in cuts], (-1, 3))
        self._normals = np.vstack([-normals, normals])
        self._points = np.reshape([cut.a for cut in cuts] + [cut.b for cut in cuts], (-1, 3))
        self._carriers = np.array([number[carrier] for carrier in carriers], dtype=np.intp)
        self._moves = np.array(
            [[c.kind == "joint" and c.arm == i and j <= c.joint for i, j in joints]
             for c in carriers], dtype=np.bool_,
        ).reshape(-1, len(joints))  # fmt: skip
        self.moved = self._moves[: len(cuts)] | self._moves[len(cuts) :]
        self._known: tuple[Array, Array, Array, Array] | None = None

    def __len__(self) -> int:
        return len(self.knots)

    @property
    def coupled(self) -> tuple[Indices, Indices]:
        """Pairs of joints that some row's second derivatives couple, upper triangle."""
        both = self._moves.T.astype(float) @ self._moves
        rows, columns = np.nonzero(np.triu(both))
        return rows, columns

    def values(self, q: Array) -> Array:
        """Values of the rows at a motion, (n, N); m, (r,)."""
        p, _, _ = self._at(q)
        ends = (self._normals * p).sum(axis=1)
        return np.asarray(ends[: len(self)] + ends[len(self) :] - self._least)

    def slopes(self, q: Array) -> Array:
        """Derivatives of the rows by the joints of their knot, (r, N)."""
        _, _, D = self._at(q)
        ends = (D @ self._normals[:, :, None])[:, :, 0]
        return np.asarray(ends[: len(self)] + ends[len(self) :])

    def bends(self, q: Array, multipliers: Array) -> Array:
        """Second derivatives of the rows' sum, each times its multiplier, (n, N, N)."""
        _, z, D = self._at(q)
        turned = np.cross(np.tile(multipliers, 2)[:, None, None] * self._normals[:, None], z)
        turned *= (self._moves & self._turns)[:, :, None]
        bends = np.triu(turned @ D.swapaxes(1, 2))
        bends += np.triu(bends, 1).swapaxes(1, 2)
        total = np.zeros((len(q), *bends.shape[1:]))
        np.add.at(total, np.tile(self.knots, 2), bends)
        return total

    def _at(self, q: Array) -> tuple[Array, Array, Array]:
        """Points of the rows' ends, (2 r, 3), axes of joints there, and how they move the points,
        (2 r, N, 3).
        """
        if self._known is None or not np.array_equal(self._known[0], q):
            where = self._bodies.placed(self._course.configurations(q))
            knots = np.tile(self.knots, 2)
            R, o = where.rotations[knots, self._carriers], where.positions[knots, self._carriers]
            p = (R @ self._points[:, :, None])[:, :, 0] + o
            axes = (where.rotations[:, self._frames] @ self._axes[:, :, None])[:, :, :, 0]
            z = axes[knots]
            away = p[:, None] - where.positions[:, self._frames][knots]
            D = np.where(self._turns[:, None], np.cross(z, away), z) * self._moves[:, :, None]
            self._known = q.copy(), p, z, D
        return self._known[1:]
