"""Solids in the frames of their carriers, the pairs that may not touch, and balls round them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from copose.collision.carriers import Placements, carrier_poses, carriers_of
from copose.collision.distance.segments import Segments
from copose.collision.shapes.solids import Shape, Solid
from copose.poses import Array, Indices, Pose
from copose.robots import Arm


@dataclass(frozen=True, eq=False)
class PlacedPart:
    """A part of a solid, in the frame of the solid's carrier."""

    shape: Shape
    pose: Pose  # the shape's frame in the carrier's
    carrier: int  # number of the carrier

    @property
    def hull(self) -> tuple[Array, float]:
        """Points in the carrier's frame, (n, 3), and a distance, m: all within it of their convex
        hull holds the part.
        """
        points, beyond = self.shape.hull
        return points @ self.pose.rotation.T + self.pose.position, beyond

    def at(self, where: Placements) -> tuple[Array, Array]:
        """Rotation and position in the world, in one configuration."""
        R = where.rotations[self.carrier]
        return R @ self.pose.rotation, R @ self.pose.position + where.positions[self.carrier]


class PartPoses:
    """The placements of parts in one configuration, as coal takes them.

    Attributes:
        where: the placements of the carriers.
    """

    def __init__(self, where: Placements) -> None:
        self.where = where
        self._known: dict[int, Any] = {}

    def __call__(self, part: PlacedPart) -> Any:
        """The placement of a part."""
        import coal

        if id(part) not in self._known:
            self._known[id(part)] = coal.Transform3s(*part.at(self.where))
        return self._known[id(part)]


def ball_round(parts: Sequence[PlacedPart]) -> tuple[Array, float]:
    """Centre, (3,), and radius, m, of a ball round parts, about the middle of their extent."""
    points, reach = [], []
    for part in parts:
        corners, beyond = part.hull
        points.append(corners)
        reach += [beyond] * len(corners)
    x, r = np.vstack(points), np.array(reach)[:, None]
    centre = ((x - r).min(axis=0) + (x + r).max(axis=0)) / 2
    return centre, float((np.linalg.norm(x - centre, axis=1) + r[:, 0]).max())


def segments_of(parts: Sequence[PlacedPart | None]) -> Segments:
    """Segments in the frames of their carriers that round parts are within a radius of; points at
    the origin for what is None, (s, 3) each.
    """
    ends = np.zeros((len(parts), 2, 3))
    for k, part in enumerate(parts):
        if part is not None:
            ends[k] = part.hull[0]
    return Segments(ends[:, 0], ends[:, 1] - ends[:, 0])


class PairedSolids:
    """Solids and the pairs of them that are tested, in any configuration.

    Configurations are rows as `configurations` makes them.

    Attributes:
        solids: as in the scene.
        pairs: the two solids of each tested pair, (p, 2).
        arms: that carry them.
        carriers: in the order of `Placements`.
        carrier: number of each solid's carrier, (s,).
        placed_parts: the parts of each solid in its carrier's frame.
        centres: of a ball round every solid, in its carrier's frame, m, (s, 3).
        radii: of these balls, m, (s,).
        pair_arms: the arms that move the two solids of each pair, −1 for none, (p, 2).
    """

    def __init__(self, solids: Sequence[Solid], pairs: Indices, arms: Sequence[Arm]) -> None:
        """Find a ball round each solid; pairs of them, (p, 2), are tested against each other."""
        self.solids, self.pairs, self.arms = tuple(solids), pairs, tuple(arms)
        self.carriers = carriers_of(arms)
        number = {carrier: i for i, carrier in enumerate(self.carriers)}
        self.carrier = np.array([number[solid.carrier] for solid in solids], dtype=np.intp)
        self.placed_parts = [
            [PlacedPart(part.shape, solid.placement @ part.placement, number[solid.carrier])
             for part in solid.parts]
            for solid in solids
        ]  # fmt: skip
        balls = [ball_round(parts) for parts in self.placed_parts]
        self.centres = np.reshape([centre for centre, _ in balls], (-1, 3))
        self.radii = np.array([radius for _, radius in balls])
        moved = np.array([s.carrier.arm if s.carrier.kind == "joint" else -1 for s in solids], int)
        self.pair_arms = moved[pairs]
        # The same configurations are often asked for several times in a row.
        self._latest: tuple[bytes, Placements] | None = None

    def own(self, i: int) -> Indices:
        """Tested pairs that only arm i moves against each other, or against what stands still."""
        alone = (self.pair_arms == i) | (self.pair_arms == -1)
        return np.flatnonzero(alone.all(axis=1) & (self.pair_arms == i).any(axis=1))

    @cached_property
    def shared(self) -> Indices:
        """Tested pairs of solids of two arms."""
        return np.flatnonzero(
            (self.pair_arms >= 0).all(axis=1) & (self.pair_arms[:, 0] != self.pair_arms[:, 1])
        )

    @cached_property
    def still(self) -> Indices:
        """Tested pairs that no joint moves."""
        return np.flatnonzero((self.pair_arms < 0).all(axis=1))

    @cached_property
    def every(self) -> Indices:
        """All tested pairs."""
        return np.arange(len(self.pairs))

    def names(self, pair: int) -> tuple[str, str]:
        """Names of the two solids of a tested pair."""
        a, b = self.pairs[pair]
        return self.solids[a].name, self.solids[b].name

    def parts_of(self, pair: int) -> Iterator[tuple[PlacedPart, PlacedPart]]:
        """The parts of a pair of solids, each of one with each of the other."""
        a, b = self.pairs[pair]
        return ((one, other) for one in self.placed_parts[a] for other in self.placed_parts[b])

    def placed(self, x: Array) -> Placements:
        """Placements of all carriers in configurations, (count, size)."""
        key = x.tobytes()
        if self._latest is None or self._latest[0] != key:
            self._latest = key, carrier_poses(self.arms, x)
        return self._latest[1]

    def ball_centres(self, where: Placements) -> Array:
        """Centres of the balls round all solids in the world, m, (..., s, 3)."""
        i = self.carrier
        centres = np.einsum("...sij,sj->...si", where.rotations[..., i, :, :], self.centres)
        return np.asarray(centres + where.positions[..., i, :])

    def bounds(self, where: Placements, pairs: Indices) -> Array:
        """Distances of one ball round each solid of some pairs, m, (..., k)."""
        centres = self.ball_centres(where)
        a, b = self.pairs[pairs].T
        gaps = np.linalg.norm(centres[..., a, :] - centres[..., b, :], axis=-1)
        bounds: Array = gaps - self.radii[a] - self.radii[b]
        return bounds
