"""Distances between solids: exact ones by coal, bounds by balls and capsules around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from copose.collision.carriers import Carrier, Placements
from copose.collision.solids import Mesh, Solid
from copose.poses import Array, Indices


@dataclass(frozen=True, eq=False)
class Balls:
    """One ball round every solid, in its carrier's frame.

    Attributes:
        centres: shape (s, 3).
        radii: shape (s,).
    """

    centres: Array
    radii: Array

    @classmethod
    def of(cls, solids: Sequence[Solid]) -> Balls:
        """Balls about the middle of each solid's extent."""
        centres, radii = [], []
        for solid in solids:
            points, reach = [], []
            for part in solid.parts:
                pose = solid.placement @ part.placement
                corners, beyond = part.shape.hull
                points.append(corners @ pose.rotation.T + pose.position)
                reach += [beyond] * len(corners)
            x, r = np.vstack(points), np.array(reach)[:, None]
            centre = ((x - r).min(axis=0) + (x + r).max(axis=0)) / 2
            centres.append(centre)
            radii.append((np.linalg.norm(x - centre, axis=1) + r[:, 0]).max())
        return cls(np.reshape(centres, (-1, 3)), np.array(radii))


@dataclass(frozen=True, eq=False)
class Inside:
    """Whom to ask whether one solid lies wholly within a mesh of another.

    Attributes:
        pairs: which pair, shape (k,).
        meshes: the mesh that may enclose, k of them.
        frames: R and p of each mesh in its carrier's frame, shapes (k, 3, 3) and (k, 3).
        outer: number of the mesh's carrier, shape (k,).
        points: a point of the other solid, in its carrier's frame, shape (k, 3).
        inner: number of the point's carrier, shape (k,).
        low: lowest coordinates of the mesh, in its own frame, shape (k, 3); ``high`` alike.
    """

    pairs: Indices
    meshes: tuple[Mesh, ...]
    frames: tuple[Array, Array]
    outer: Indices
    points: Array
    inner: Indices
    low: Array
    high: Array

    @classmethod
    def of(cls, solids: Sequence[Solid], carrier: Indices, pairs: Indices) -> Inside:
        """All meshes of either solid of every pair, each with a point of every part of the other.

        A part that no surface crosses is inside as a whole, or outside.
        """
        rows = []
        for k, (i, j) in enumerate(pairs):
            for outer, inner in ((i, j), (j, i)):
                for part in solids[outer].parts:
                    if not isinstance(part.shape, Mesh):
                        continue
                    frame = solids[outer].placement @ part.placement
                    for other in solids[inner].parts:
                        place = solids[inner].placement @ other.placement
                        point = place.rotation @ other.shape.witness + place.position
                        rows.append((k, part.shape, frame, outer, point, inner))
        return cls(
            pairs=np.array([row[0] for row in rows], dtype=np.intp),
            meshes=tuple(row[1] for row in rows),
            frames=(
                np.reshape([row[2].rotation for row in rows], (-1, 3, 3)),
                np.reshape([row[2].position for row in rows], (-1, 3)),
            ),
            outer=carrier[[row[3] for row in rows]],
            points=np.reshape([row[4] for row in rows], (-1, 3)),
            inner=carrier[[row[5] for row in rows]],
            low=np.reshape([row[1].extent[0] for row in rows], (-1, 3)),
            high=np.reshape([row[1].extent[1] for row in rows], (-1, 3)),
        )

    def found(self, where: Placements) -> set[int]:
        """Pairs of which one solid lies within a mesh of the other."""
        R, p = where.rotations, where.positions
        x = np.einsum("kij,kj->ki", R[self.inner], self.points) + p[self.inner] - p[self.outer]
        x = np.einsum("kji,kj->ki", R[self.outer], x) - self.frames[1]
        x = np.einsum("kji,kj->ki", self.frames[0], x)
        near = np.flatnonzero(np.all((x >= self.low) & (x <= self.high), axis=1))
        return {int(self.pairs[k]) for k in near if self.meshes[k].encloses(x[k])}


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances of pairs of solids, wherever their carriers are.

    Attributes:
        solids: the solids.
        pairs: the two solids of each pair, shape (p, 2).
        carriers: in the order of the placements.
    """

    solids: tuple[Solid, ...]
    pairs: Indices
    carriers: tuple[Carrier, ...]

    @cached_property
    def carrier(self) -> Indices:
        """Number of each solid's carrier, shape (s,)."""
        number = {carrier: i for i, carrier in enumerate(self.carriers)}
        return np.array([number[solid.carrier] for solid in self.solids], dtype=np.intp)

    @cached_property
    def _balls(self) -> Balls:
        return Balls.of(self.solids)

    @cached_property
    def _inside(self) -> Inside:
        return Inside.of(self.solids, self.carrier, self.pairs)

    def ball_bounds(self, where: Placements) -> Array:
        """Distances of one ball round each solid, for all pairs, shape (p,)."""
        balls, i = self._balls, self.carrier
        centres = np.einsum("sij,sj->si", where.rotations[i], balls.centres) + where.positions[i]
        first, second = self.pairs.T
        gaps = np.linalg.norm(centres[first] - centres[second], axis=1)
        bounds: Array = gaps - balls.radii[first] - balls.radii[second]
        return bounds

    def enclosed(self, where: Placements) -> set[int]:
        """Pairs of which one solid lies within a mesh of the other, perhaps without touching it."""
        return self._inside.found(where)

    def exact(self, pair: int, where: Placements, most: float = np.inf) -> float:
        """Distance of the original shapes of a pair, at most ``most``; ≤ 0 where they overlap.

        A mesh is its surface here; see `enclosed`.

        Args:
            pair: which.
            where: the placements of the carriers.
            most: what is larger need not be told apart, which saves much of the time.
        """
        import coal

        first, second = (self._placed(int(i), where) for i in self.pairs[pair])
        least = most
        for shape, there in first:
            for other, its in second:
                result = coal.DistanceResult()
                if 0 < least < np.inf:
                    result.min_distance = least
                found = coal.distance(shape, there, other, its, coal.DistanceRequest(), result)
                least = min(least, float(found))
        return least

    def touch(self, pair: int, where: Placements) -> bool:
        """Whether the original shapes of a pair overlap; a mesh is its surface here."""
        import coal

        request = coal.CollisionRequest()
        first, second = (self._placed(int(i), where) for i in self.pairs[pair])
        return any(
            coal.collide(shape, there, other, its, request, coal.CollisionResult()) > 0
            for shape, there in first
            for other, its in second
        )

    def _placed(self, solid: int, where: Placements) -> list[tuple[Any, Any]]:
        """The shapes of a solid for coal, and where they are."""
        import coal

        i = self.carrier[solid]
        R, p = where.rotations[i], where.positions[i]
        return [
            (shape, coal.Transform3s(R @ rotation, R @ position + p))
            for shape, rotation, position in self._parts[solid]
        ]

    @cached_property
    def _parts(self) -> tuple[list[tuple[Any, Array, Array]], ...]:
        found = []
        for solid in self.solids:
            poses = [solid.placement @ part.placement for part in solid.parts]
            found.append(
                [
                    (part.shape.coal, pose.rotation, pose.position)
                    for part, pose in zip(solid.parts, poses, strict=True)
                ]
            )
        return tuple(found)
