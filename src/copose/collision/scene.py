"""The scene of a problem: solids of arms, object and obstacles, and the pairs that are tested."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision.carriers import OBJECT, WORLD, Carrier, configurations
from copose.collision.distance.bodies import Bodies
from copose.collision.shapes.primitives import Primitive
from copose.collision.shapes.solids import LinkLook, LinkSolids, Part, Solid
from copose.errors import blamed_on
from copose.poses import Array, Indices, Mask, Pose
from copose.problem import CapsuleShape, PlanarArm, Problem, Shape
from copose.robots import Arm, finite_range


def possible_pairs(
    solids: Sequence[Solid], arms: Sequence[Arm], mounts: Collection[tuple[int, str]]
) -> list[tuple[int, int]]:
    """The pairs i < j of solids but those that are rigidly attached, stand still, or may touch;
    mounts are (arm, name) of the static solids that an arm's first joint hangs on.
    """
    return [
        (i, j)
        for j, b in enumerate(solids)
        for i, a in enumerate(solids[:j])
        if not (_may_touch(a, b, arms, mounts) or _may_touch(b, a, arms, mounts))
    ]


def _may_touch(
    a: Solid, b: Solid, arms: Sequence[Arm], mounts: Collection[tuple[int, str]]
) -> bool:
    """True where b is one body with a, stands still as a does, or is next to a in its chain."""
    one, other = a.carrier, b.carrier
    if one == other or (one.static and other.static):
        return True
    if one.kind != "joint":
        return False
    if other.kind == "joint":
        return one.arm == other.arm and abs(one.joint - other.joint) == 1
    if other.kind == "object":
        return one.joint == arms[one.arm].n - 1
    return one.joint == 0 and (one.arm, b.name) in mounts


@dataclass(frozen=True, eq=False)
class Scene:
    """The solids of a problem and the pairs of them that may not touch."""

    solids: tuple[Solid, ...]  # links of arms and robots, object, obstacles
    pairs: Indices  # the two solids of each tested pair, numbers in ``solids``, (p, 2)
    notes: tuple[str, ...]  # remarks on shapes, for the reader
    planar: bool  # whether it lies in a plane

    @classmethod
    def of(cls, problem: Problem, arms: Sequence[Arm]) -> Scene:
        """The scene of a problem.

        Raises:
            InputError: an arm has no shape, or its robot cannot be read.
        """
        with blamed_on(problem.source):
            links = link_solids(problem, arms)
        solids, notes = [*links.solids], [*links.notes]
        if problem.object.shape is None:
            notes.append(
                "the object has no shape: nothing is tested against it; give [object] shape"
            )
        else:
            solids.append(_alone("object", OBJECT, Pose.from_rpy(), problem.object.shape))
        for obstacle in problem.obstacles:
            solids.append(_alone(obstacle.name, WORLD, obstacle.pose, obstacle.shape))
        names = [solid.name for solid in solids]
        tested = [
            (i, j) for i, j in possible_pairs(solids, arms, links.mounts)
            if frozenset((names[i], names[j])) not in links.ignored
        ]  # fmt: skip
        pairs = np.reshape(tested, (-1, 2)).astype(np.intp)
        planar, clearance = problem.space.planar, problem.constraints.clearance
        bodies = Bodies(solids, pairs, arms, clearance, planar=planar)
        near = _always_near(bodies, _random_postures(problem, arms))
        return cls(tuple(solids), pairs[~near], tuple(notes), planar)

    def bodies(self, arms: Sequence[Arm], clearance: float) -> Bodies:
        """Distance queries of the solids, carried by arms as in the problem."""
        return Bodies(self.solids, self.pairs, arms, clearance, planar=self.planar)


def link_solids(problem: Problem, arms: Sequence[Arm]) -> LinkSolids:
    """The links of all arms.

    Raises:
        InputError: an arm has no shape, or its robot cannot be read.
    """
    if problem.space.planar:
        planar = [(i, spec) for i, spec in enumerate(problem.arms) if isinstance(spec, PlanarArm)]
        return LinkSolids(tuple(link for i, spec in planar for link in _planar_links(spec, i)))
    # Pinocchio takes a quarter of a second to load, which planar problems need not wait for.
    from copose.collision.links.robot_links import robot_solids

    return robot_solids(problem, arms)


def link_looks(problem: Problem, arms: Sequence[Arm]) -> list[LinkLook]:
    """Shapes by which the links of all arms are shown; no mesh file is read yet.

    Raises:
        InputError: a robot cannot be read.
    """
    if problem.space.planar:
        return [
            LinkLook(solid.name.rpartition("/")[2], solid.carrier, solid.placement, (solid.parts,))
            for solid in link_solids(problem, arms).solids
        ]
    from copose.collision.links.robot_links import robot_looks

    return robot_looks(problem, arms)


def _planar_links(spec: PlanarArm, arm: int) -> Iterator[Solid]:
    """The links of a planar arm: all points within a radius of the segment from joint to joint."""
    for i, link in enumerate(spec.links):
        shape = Primitive("capsule", (link.radius, link.length))
        along = Pose.from_rpy((link.length / 2, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
        yield Solid(
            f"{spec.name}/link{i + 1}",
            Carrier("joint", arm, i),
            Pose.from_rpy(),
            (Part(shape, along),),
        )


def _alone(name: str, carrier: Carrier, pose: Pose, shape: Shape | CapsuleShape) -> Solid:
    """The solid of a shape of the problem file."""
    return Solid(name, carrier, pose, (Part(primitive_of(shape), Pose.from_rpy()),))


def primitive_of(shape: Shape | CapsuleShape) -> Primitive:
    """The primitive that a shape of the problem file is, in space or in the plane."""
    kind = "sphere" if shape.kind == "disk" else shape.kind
    return Primitive(kind, shape.measures, flat=shape.flat)


def _random_postures(
    problem: Problem, arms: Sequence[Arm], count: int = 200, seed: int = 20
) -> Iterator[Array]:
    """Configurations: joint positions drawn within limits, and free bases within their ranges."""
    rng = np.random.default_rng(seed)
    ranges = [finite_range(arm.lower, arm.upper) for arm in arms]
    for _ in range(count):
        bases = []
        for spec, arm in zip(problem.arms, arms, strict=True):
            free = spec.freedom.base.ranges
            drawn = {name: rng.uniform(*interval) for name, interval in free.items()}
            bases.append(arm.base.displaced(drawn, "yaw"))
        q = [rng.uniform(low, high) for low, high in ranges]
        yield configurations(arms, bases, q, problem.object.pose)


def _always_near(bodies: Bodies, postures: Iterator[Array]) -> Mask:
    """True for pairs that are nearer than the clearance in every posture, (p,).

    Only pairs that an arm's joints move count: an object that is held in the way of something fixed
    collides with it in all postures.
    """
    kinds = [{bodies.solids[i].carrier.kind, bodies.solids[j].carrier.kind}
             for i, j in bodies.pairs]  # fmt: skip
    near = np.array(["joint" in kind and "object" not in kind for kind in kinds], dtype=np.bool_)
    for x in postures:
        left = np.flatnonzero(near)
        if not len(left):
            break
        near[left] = bodies.too_near(x[0], left)
    return near
