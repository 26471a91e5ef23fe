"""Self-motions of an arm that slices meet, as pieces from posture to posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.curve import Curve
from copose.self_motion.curves.tracing import follow
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.slices.sliced_arm import ArmSlices


@dataclass(frozen=True)
class PieceOptions:
    """Pieces of self-motions."""

    step: float = 0.008  # length, rad
    beyond: float = 0.03  # distance beyond limits from which pieces are left out, rad
    same: float = 1e-5  # difference of joints that are the same, rad


@dataclass(frozen=True, eq=False)
class SelfMotions:
    """The self-motions of an arm; where it has nothing to spare, its postures."""

    count: int  # within limits or not
    pieces: Array  # those within limits, or near them, by postures at both ends, (count, 2, n)
    numbers: Indices  # of their self-motions, from 1 on, (count,)
    ended: int  # self-motions that end, at postures without one tangent, which loops do not
    manifold: ClosureManifold  # of the arm, without limits

    @classmethod
    def of(
        cls, cell: Cell, kernels: ArmKernels, i: int, goal: Array, slices: ArmSlices,
        options: PieceOptions = PieceOptions(),
    ) -> SelfMotions:  # fmt: skip
        """The self-motions of arm i through the postures of slices."""
        n, q, free = kernels.n, slices.postures, np.full((1, kernels.n), np.inf)
        manifold = ClosureManifold(kernels, goal[None], -free, free, np.ones((1, n), dtype=bool))
        if n == kernels.m:
            curves, parts = [], [np.stack([q, q], axis=1)]
        else:
            curves = _curves(manifold, q, options.same)
            tracks = [Track.of(curve, cell.system.space.rigid) for curve in curves]
            parts = [np.zeros((0, 2, n)), *(_pieces(track, options.step) for track in tracks)]
        pieces = np.concatenate(parts)
        near = cell.beyond(i, pieces.mean(axis=1)) <= options.beyond
        numbers = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        ended = sum(not curve.loop for curve in curves)
        return cls(len(curves) if n > kernels.m else len(q), pieces[near], numbers[near], ended,
                   manifold)  # fmt: skip


def _curves(manifold: ClosureManifold, q: Array, same: float) -> list[Curve]:
    """The curves through postures, (count, n), each once."""
    curves, left = list[Curve](), q
    while len(left):
        curves += follow(manifold, left[:1])
        # A posture is on its curve, whether that is told or not.
        left = left[1:][~_on(curves[-1], left[1:], same)]
    return curves


def _on(curve: Curve, q: Array, same: float) -> Mask:
    """Postures, (count, n), that are on a curve."""
    if not len(q):
        return np.zeros(0, dtype=bool)
    rows = (np.exp(1j * q) @ np.exp(-1j * curve.points).T).real.argmax(axis=1)
    offset = np.angle(np.exp(1j * (q - curve.points[rows])))
    x, closed = curve.at(rows, (offset * curve.tangents[rows]).sum(axis=1))
    near = np.abs(x - curve.points[rows] - offset).max(axis=1) < same
    return np.asarray(closed & near)


def _pieces(track: Track, step: float) -> Array:
    """Pieces of a curve, from posture to posture, (count, 2, n)."""
    count = max(1, int(np.ceil(track.length / step)))
    points = track.closed(np.linspace(0.0, track.length, count + 1))
    if track.loop:
        points[-1] = points[0] + track.points[-1] - track.points[0]
    return np.stack([points[:-1], points[1:]], axis=1)
