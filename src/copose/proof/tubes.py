"""Tubes that are proved to enclose pieces of an arm's self-motion, and its chain along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Mask, rotation_rows, skew
from copose.problem import Space
from copose.proof.intervals import Interval
from copose.proof.taylor import Taylor, cosines_and_sines, cross, inverse_model, joined
from copose.robots import Arm


@dataclass(frozen=True)
class TubeOptions:
    """Proofs of tubes."""

    off: float = 1e-11  # distance of a middle from its self-motion, at most, rad
    tries: int = 8  # curvatures that are tried
    margin: float = 0.02  # of the first about that in the middle, rad⁻¹; and a twentieth of it
    growth: float = 1.3  # of the next


@dataclass(frozen=True, eq=False)
class ChainModel:
    """Models of an arm's chain in its root frame."""

    axes: Taylor  # of the joints, (count, 3, n)
    origins: Taylor  # of the joints, (count, 3, n)
    rotations: Sequence[Taylor]  # of the joints' frames, (count, 3, 3) each
    tip: Taylor  # origin of the tip, (count, 3, 1)
    J: Taylor  # task rows of the geometric Jacobian, (count, m, n)


@dataclass(frozen=True, eq=False)
class SelfMotionTubes:
    """Tubes of an arm whose joints all turn, with at most one degree of freedom to spare."""

    arm: Arm
    space: Space
    goal: Array  # of the tip in the root frame, see `KernelInputs`, (7,)
    options: TubeOptions = TubeOptions()

    def chain(self, q: Taylor) -> ChainModel:
        """The chain at joints, (count, n)."""
        c, s = (x[:, :, None, None] for x in cosines_and_sines(q))
        R, p = Taylor.fixed(np.eye(3)[None], q.h), Taylor.fixed(np.zeros((1, 3, 1)), q.h)
        axes, origins, rotations = [], [], []
        for i, joint in enumerate(self.arm.joints):
            p = p + R @ joint.placement.position[:, None]
            along = np.outer(joint.axis, joint.axis)
            turn = c[:, i] * (np.eye(3) - along) + s[:, i] * skew(joint.axis) + along
            R = R @ joint.placement.rotation @ turn
            axes.append(R @ joint.axis[:, None])
            origins.append(p)
            rotations.append(R)
        tip, z, o = p + R @ self.arm.tip.position[:, None], joined(axes, 2), joined(origins, 2)
        J = joined([cross(z, tip - o), z], 1)[:, list(self.space.rows)]
        return ChainModel(z, o, rotations, tip, J)

    def _residual(self, q: Array) -> Array:
        """Bounds of the closure at postures, m and rad, (count, m, 1).

        In extended precision, where there is one: all that rounds here makes bounds looser.
        """
        q = q.astype(np.longdouble)
        chain = self.chain(Taylor.fixed(q, np.zeros(len(q), dtype=q.dtype)))
        back = np.array(rotation_rows(self.goal[3:])).T
        R = chain.rotations[-1].value @ self.arm.tip.rotation.astype(q.dtype) @ back
        skewed = (R - R.map(lambda x: x.swapaxes(1, 2))).size[:, [2, 0, 1], [1, 2, 0]] / 2
        off = (chain.tip.value - self.goal[:3, None]).size
        return np.concatenate([off, skewed[..., None]], axis=1)[:, list(self.space.rows)]

    def enclosed(self, middle: Array, tangent: Array, h: Array) -> tuple[Taylor, Mask]:
        """Models q(t) of the self-motion through postures, |t| ≤ h, vᵀ(q − middle) = t; and where
        they are proved.

        With N = [J; vᵀ] regular all over a tube N q′ = (0, 1) and q″ = −N⁻¹(J′q′, 0): where the q″
        of a tube is narrower than the tube's own the self-motion cannot leave it (É. Picard). The
        middle is near the self-motion by the theorem on Newton's method. Without a degree of
        freedom to spare q is a posture.

        Args:
            middle: closed postures, (count, n).
            tangent: unit tangents v there, (count, n).
            h: half of the lengths of the pieces, (count,).
        """
        (count, n), options = middle.shape, self.options
        slope, bend = Interval.exactly(tangent), Interval.exactly(np.zeros((count, n)))
        value = Interval(middle, np.full((count, n), options.off))
        proved, rows, r = np.zeros(count, dtype=bool), np.arange(count), self._residual(middle)
        for attempt in range(options.tries):
            q = Taylor.of([value, slope, bend], h * (attempt > 0)).taken(rows)
            J = self.chain(q).J
            plane = [Taylor.fixed(tangent[rows, None], q.h)] * (n > self.space.m)
            Y, regular = inverse_model(joined([J, *plane], 1))
            off = 2 * (Y.whole.size[:, :, : r.shape[1]] @ r[rows])[..., 0].astype(float)
            regular &= (off < options.off).all(axis=1)
            value.rad[rows] = np.minimum(value.rad[rows], off * (1 + 1e-9))
            if not plane:
                return Taylor.of([value, slope, bend], h), regular
            turned = J.slopes @ q.slopes.map(lambda x: x[..., None])
            new = (Y.whole.map(lambda x: x[:, :, :-1]) @ turned * -0.5).map(lambda x: x[..., 0])
            if attempt == 0:
                slope, largest = Y.value.map(lambda x: x[:, :, -1]), np.abs(new.mid).max(axis=1)
                bend = Interval(new.mid, options.margin + 0.05 * largest[:, None] + 0 * new.mid)
                continue
            good = regular & (np.abs(new.mid - bend.mid[rows]) + new.rad < bend.rad[rows]).all(
                axis=1
            )
            wider = np.where(good[:, None], new.rad, options.growth * new.rad + 1e-3)
            bend.mid[rows], bend.rad[rows], proved[rows[good]] = new.mid, wider, True
            rows = rows[~good & (wider.max(axis=1) < 1e4)]
            if not len(rows):
                break
        return Taylor.of([value, slope, bend], h), proved
