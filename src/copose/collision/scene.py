"""All that may touch in a problem, and how near it comes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from copose.collision.carriers import (
    OBJECT,
    WORLD,
    Carrier,
    Placements,
    carrier_poses,
    carriers_of,
)
from copose.collision.distances import Distances
from copose.collision.pairs import possible_pairs
from copose.collision.solids import Part, Primitive, Solid
from copose.errors import InputError
from copose.poses import Indices, Mask, Pose
from copose.problem import PlanarArm, Problem
from copose.robots import Arm, finite_range

# Random postures in which a pair must come near each time to be left out, and their seed.
_POSTURES = 200
_SEED = 20


@dataclass(frozen=True)
class Nearest:
    """The two tested solids that are nearest to each other.

    Attributes:
        distance: of the original shapes, m; ≤ 0 where they overlap.
        pair: their names.
    """

    distance: float
    pair: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Scene:
    """The solids of a problem and which of them may not touch.

    Attributes:
        solids: links of arms and robots, object, obstacles.
        pairs: the two solids of each tested pair, numbers in ``solids``, shape (p, 2).
        carriers: what moves solids, in the order of `Placements`.
        notes: what the reader should know of shapes.
    """

    solids: tuple[Solid, ...]
    pairs: Indices
    carriers: tuple[Carrier, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, problem: Problem, arms: Sequence[Arm]) -> Scene:
        """The scene of a problem.

        Raises:
            InputError: an arm has no shape, or its URDF cannot be read.
        """
        try:
            return cls._of(problem, arms)
        except InputError as error:
            raise InputError(error.message, key=error.key, file=problem.source) from None

    @classmethod
    def _of(cls, problem: Problem, arms: Sequence[Arm]) -> Scene:
        solids: list[Solid] = []
        mounts: frozenset[tuple[int, str]] = frozenset()
        notes: list[str] = []
        if problem.space.planar:
            for i, spec in enumerate(problem.arms):
                if isinstance(spec, PlanarArm):
                    solids += _planar_links(spec, i)
        else:
            # Pinocchio takes a quarter of a second to load, which planar problems need not wait
            # for.
            from copose.collision.robot_solids import robot_solids

            robots = robot_solids(problem, arms)
            solids += robots.solids
            mounts = robots.mounts
            notes += robots.notes
        if problem.object.shape is None:
            notes.append("the object has no shape: nothing is tested against it")
        else:
            solids.append(_alone("object", OBJECT, Pose.from_rpy(), problem.object.shape))
        for obstacle in problem.obstacles:
            solids.append(_alone(obstacle.name, WORLD, obstacle.pose, obstacle.shape))
        carriers = carriers_of(arms)
        pairs = np.reshape(possible_pairs(solids, arms, mounts), (-1, 2)).astype(np.intp)
        all_pairs = Distances(tuple(solids), pairs, carriers)
        clearance = problem.constraints.clearance
        near = _always_near(all_pairs, _random_postures(problem, arms), clearance)
        return cls(tuple(solids), pairs[np.flatnonzero(~near)], carriers, tuple(notes))

    @cached_property
    def distances(self) -> Distances:
        """Distances of the tested pairs."""
        return Distances(self.solids, self.pairs, self.carriers)

    def nearest(self, where: Placements) -> Nearest | None:
        """The pair with the smallest exact distance; None where no pair is tested.

        Distances of balls round the solids are never larger: exact distances are measured in
        ascending order of these, until one exceeds the smallest. Of pairs that may overlap all are
        measured, for no bound tells how deep they do. Where a solid lies within a mesh, its
        distance to the surface counts as the depth.

        Args:
            where: the placements of the carriers, as `carrier_poses` gives them.
        """
        if not len(self.pairs):
            return None
        distances = self.distances
        bounds = distances.ball_bounds(where)
        least, which = np.inf, -1
        for k in np.argsort(bounds, kind="stable"):
            if bounds[k] > max(least, 0.0):
                break
            found = distances.exact(int(k), where, least if least > 0 else np.inf)
            if found < least:
                least, which = found, int(k)
        for k in sorted(distances.enclosed(where)):
            depth = -abs(distances.exact(k, where))
            if depth < least:
                least, which = depth, k
        i, j = self.pairs[which]
        return Nearest(least, (self.solids[i].name, self.solids[j].name))

    def overlapping(self, where: Placements) -> tuple[str, str] | None:
        """The names of a pair that overlaps, or None where none does; without any capsule."""
        distances = self.distances
        near = np.flatnonzero(distances.ball_bounds(where) <= 0)
        found = next((int(k) for k in near if distances.touch(int(k), where)), None)
        if found is None:
            found = min(distances.enclosed(where), default=None)
        if found is None:
            return None
        i, j = self.pairs[found]
        return self.solids[i].name, self.solids[j].name


def _planar_links(spec: PlanarArm, arm: int) -> Iterator[Solid]:
    """Link i of a planar arm: all within its radius of the segment from its joint to its end."""
    for i, link in enumerate(spec.links):
        shape = Primitive("capsule", (link.radius, link.length))
        along = Pose.from_rpy((link.length / 2, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
        yield Solid(
            f"{spec.name}/link{i + 1}",
            Carrier("joint", arm, i),
            Pose.from_rpy(),
            (Part(shape, along),),
        )


def _alone(name: str, carrier: Carrier, pose: Pose, shape: Any) -> Solid:
    """The solid of a shape of the problem file."""
    return Solid(name, carrier, pose, (Part(_primitive(shape), Pose.from_rpy()),))


def _primitive(shape: Any) -> Primitive:
    """A shape of the problem file, of space or of the plane."""
    if shape.kind == "box":
        return Primitive("box", shape.size, flat=len(shape.size) == 2)
    if shape.kind in ("sphere", "disk"):
        return Primitive("sphere", (shape.radius,), flat=shape.kind == "disk")
    return Primitive(shape.kind, (shape.radius, shape.length))


def _random_postures(problem: Problem, arms: Sequence[Arm]) -> Iterator[Placements]:
    """Joint positions drawn within their limits, and free bases within their ranges."""
    rng = np.random.default_rng(_SEED)
    ranges = [finite_range(arm.lower, arm.upper) for arm in arms]
    for _ in range(_POSTURES):
        bases = []
        for spec, arm in zip(problem.arms, arms, strict=True):
            free = spec.freedom.base.ranges
            drawn = {name: rng.uniform(*interval) for name, interval in free.items()}
            bases.append(arm.base.displaced(drawn, "yaw"))
        q = [rng.uniform(low, high) for low, high in ranges]
        yield carrier_poses(arms, bases, q, problem.object.pose)


def _always_near(distances: Distances, postures: Iterator[Placements], clearance: float) -> Mask:
    """Which pairs are nearer than the clearance in every posture, shape (p,).

    Only of pairs that an arm's joints move against each other: an object that is held in the way
    of something fixed collides with it, however often one looks.
    """
    kinds = [
        {distances.solids[i].carrier.kind, distances.solids[j].carrier.kind}
        for i, j in distances.pairs
    ]
    near = np.array(["joint" in kind and "object" not in kind for kind in kinds], dtype=np.bool_)
    for where in postures:
        some = np.flatnonzero(near)
        if not len(some):
            break
        within = distances.enclosed(where)
        bounds = distances.ball_bounds(where)[some]
        for k, bound in zip(some, bounds, strict=True):
            # A mesh counts as its surface here, which touches at 0 whatever the clearance is.
            gap = distances.exact(int(k), where, clearance) if bound <= clearance else np.inf
            near[k] = gap < clearance or gap <= 0 or k in within
    return near
