"""What is answered: a result as frozen data, the same as in `result.json`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, model_serializer
from pydantic_core.core_schema import SerializerFunctionWrapHandler

from copose.collision import Solid, link_outlines
from copose.display import Displayed
from copose.poses import Array, Pose
from copose.problem import Obstacle, PlanarObstacle, Problem, Shape, SpaceName
from copose.results import arrays
from copose.results.limits import AccelerationRecord, ExactSetRecord, WrenchRecord
from copose.results.records import (
    CompanionRecord,
    EllipsoidRecord,
    Finite,
    Matrix,
    Record,
    Vector,
    matrix,
    vector,
)
from copose.robots import Arm

if TYPE_CHECKING:
    import pandas
    import xarray


class SpatialPlace(Record):
    """Pose of the object's centre of mass: position, m, and unit quaternion [w, x, y, z]."""

    position: tuple[Finite, Finite, Finite]
    quaternion: tuple[Finite, Finite, Finite, Finite]


class PlanarPlace(Record):
    """Pose of the object's centre of mass in the plane."""

    position: tuple[Finite, Finite]
    angle: Finite


def place(pose: Pose, planar: bool) -> SpatialPlace | PlanarPlace:
    """A pose as a result states it."""
    if planar:
        angle = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        return PlanarPlace.model_validate({"position": vector(pose.position[:2]), "angle": angle})
    return SpatialPlace.model_validate(
        {"position": vector(pose.position), "quaternion": vector(pose.quaternion)}
    )


class SpatialFrame(Record):
    """A base in the world or a grasp in the object: position, m, and roll, pitch, yaw, rad."""

    position: tuple[Finite, Finite, Finite]
    rpy: tuple[Finite, Finite, Finite]


def frame(pose: Pose, planar: bool) -> SpatialFrame | PlanarPlace:
    """A base or a grasp as a problem file states it."""
    if planar:
        return PlanarPlace.model_validate(place(pose, planar).model_dump())
    return SpatialFrame.model_validate({"position": vector(pose.position), "rpy": vector(pose.rpy)})


class CollisionRecord(Record):
    """The smallest distance of what may not touch, m, and between which two it is."""

    distance: Finite
    pair: tuple[str, str]


class ArmRecord(Record):
    """One arm of a posture.

    Attributes:
        skeleton: root, joint origins and tip in the world, m.
        quaternions: of the same frames, [w, x, y, z].
        grasp: where the tip should be, m.
        ellipsoid: of the arm alone at its tip, by the same resolution and torque scaling.
    """

    skeleton: Matrix
    quaternions: Matrix
    grasp: Vector
    ellipsoid: EllipsoidRecord


class Posture(Record):
    """Joint positions and what they are worth.

    Of what torque limits allow a posture states what was asked for, `copose evaluate` all; null
    is what does not exist, and a key that nothing asked for is left out.

    Attributes:
        joints: rad or m, by arm.
        object: where the object is.
        closure_error: the larger of a tip's position error, m, and angle error, rad, by arm; in the
            linear spaces the position error.
        ellipsoid: of the system, at the object's centre of mass.
        log_volumes: by resolution, whichever is optimised.
        arms: each arm's own.
        payload: kg, the largest mass of the object that can be held with every joint at rest, or
            accelerated as the objective asks with the least-norm joint accelerations.
        static_torque: share of each joint's limit in the hold whose largest share is smallest.
        torque_shares: alike, of each extreme that is reported, by its name.
        residual_radius: of the largest ball of accelerations around rest.
        accelerations: the largest along directions.
        wrenches: of each extreme that is reported, by its name and by arm.
        joint_accelerations: rad/s² or m/s², alike, where joints are not at rest; of a residual
            radius those in the direction in which its ball touches the exact set's surface.
        exact_sets: linear and angular.
        companions: ellipsoids of velocities and forces, by name.
        base: where bases that may be moved are, by arm.
        grasp: where tips are in the object frame, of grasps that may be moved.
        collision: on the original geometry.
    """

    joints: dict[str, Vector]
    object: SpatialPlace | PlanarPlace
    closure_error: dict[str, Finite]
    ellipsoid: EllipsoidRecord
    log_volumes: dict[str, Finite | None]
    arms: dict[str, ArmRecord]
    payload: Finite | None = None
    static_torque: dict[str, Vector] | None = None
    torque_shares: dict[str, dict[str, Vector]] | None = None
    residual_radius: Finite | None = None
    accelerations: tuple[AccelerationRecord, ...] | None = None
    wrenches: dict[str, dict[str, WrenchRecord]] | None = None
    joint_accelerations: dict[str, dict[str, Vector]] | None = None
    exact_sets: dict[str, ExactSetRecord] | None = None
    companions: dict[str, CompanionRecord] | None = None
    base: dict[str, SpatialFrame | PlanarPlace] | None = None
    grasp: dict[str, SpatialFrame | PlanarPlace] | None = None
    collision: CollisionRecord | None = None

    @property
    def q(self) -> Array:
        """The positions of all arms' joints, rad or m, (N,)."""
        return arrays.stacked(self.joints)

    @model_serializer(mode="wrap")
    def _as_asked(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = handler(self)
        return {key: value for key, value in data.items() if key in self.model_fields_set}


class CasePosture(Posture):
    """The posture of one of the file's cases.

    Attributes:
        name: the case's.
        weight: how much it counts.
        objective: its own value.
    """

    name: str
    weight: Finite
    objective: Finite | None


class FreeRecord(Record):
    """Something that may be moved: offsets to the file's, m or rad.

    Attributes:
        name: ``object.x``, ``right.base.yaw``, …
        lower: the least; ``upper`` the largest.
        before: where it is before; null where there is no posture.
        after: alike.
    """

    name: str
    lower: Finite
    upper: Finite
    before: Finite | None
    after: Finite | None


class ObjectiveRecord(Record):
    """The objective's value before and after."""

    kind: str
    unit: str
    before: Finite | None
    after: Finite | None


class Optimum(Record):
    """A distinct local optimum.

    Attributes:
        objective: its value.
        count: polished starts that ended in it.
        joints: where, rad or m, by arm; null where more than joints is free.
    """

    objective: Finite
    count: int
    joints: dict[str, Vector] | None = None


class SampleRecord(Record):
    """What is known of one arm's self-motions.

    Attributes:
        tried: random postures that were projected onto the grasp.
        closed: postures within limits that entered the search.
        branches: self-motions found; null where more than one degree of freedom is to spare.
    """

    tried: int
    closed: int
    branches: int | None


class FailureRecord(Record):
    """A way in which polishing failed, in IPOPT's words, and how often."""

    status: str
    count: int


class VerificationRecord(Record):
    """A second search with a seed of its own and twice the effort.

    Attributes:
        seed: of the second search.
        objective: its best.
        stands: whether it is no better than the first one's by more than 1e-6.
    """

    seed: int
    objective: Finite | None
    stands: bool


class PlacementRecord(Record):
    """What was tried of the free coordinates.

    Attributes:
        tried: placements, the file's first, at which all postures were searched.
        closed: of them, at which every arm holds the object.
        polished: postures from which everything free was polished together.
    """

    tried: int
    closed: int
    polished: int


class SearchRecord(Record):
    """The evidence of a search.

    Attributes:
        seed: of everything that was drawn.
        effort: low, normal or high; ``local`` where a posture was given to go on from.
        samples: by arm.
        combinations: of the arms' postures that were evaluated.
        best_sample: the objective of the best of them.
        gap: what polishing added to that.
        starts: combinations that were polished.
        local_optima: where they ended, best first.
        failures: polishes that ended nowhere.
        verification: of the answer, where it was asked for.
        placements: where more than joints is free; the other counts are then sums over them.
    """

    seed: int
    effort: str
    samples: dict[str, SampleRecord]
    combinations: int
    best_sample: Finite | None
    gap: Finite | None
    starts: int
    local_optima: tuple[Optimum, ...]
    failures: tuple[FailureRecord, ...] = ()
    verification: VerificationRecord | None = None
    placements: PlacementRecord | None = None


class Timing(Record):
    """Seconds spent, and by what; the only part of a result that differs from run to run."""

    build_s: Finite
    search_s: Finite
    kernels: Literal["compiled", "virtual machine"] = "virtual machine"


class LinkRecord(Record):
    """The outline of one part of an arm's link.

    Attributes:
        arm: whose it is.
        frame: that moves it, a row of the arm's ``skeleton``.
        points: whose convex hull is about that of the part, in that frame, m, (k, 3).
    """

    arm: str
    frame: int
    points: Matrix


def link_records(
    solids: Sequence[Solid], arms: Sequence[Arm], *, planar: bool
) -> tuple[LinkRecord, ...]:
    """The outlines of those solids that are links of arms."""
    return tuple(
        LinkRecord(
            arm=arms[each.carrier.arm].name,
            frame=each.carrier.joint + 1,
            points=matrix(each.points),
        )
        for each in link_outlines(solids, planar=planar)
    )


class ProblemRecord(Record):
    """Which problem was solved, and what a picture of it needs.

    Attributes:
        name: as in the file.
        space: the task space.
        shape: the object's.
        axes: coordinates that the ellipsoids keep, in the order of their entries.
        resolution: whose ellipsoid is reported as ``ellipsoid``.
        torque_scaling: what the torques are measured in.
        obstacles: what stands around.
        links: of the arms; empty where a robot's shapes cannot be read.
        file: that the problem was read from, as it was named; null where it was none.
    """

    name: str
    space: SpaceName
    shape: Shape | None = None
    axes: tuple[str, ...]
    resolution: str
    torque_scaling: str
    obstacles: tuple[Obstacle | PlanarObstacle, ...] = ()
    links: tuple[LinkRecord, ...] = ()
    file: str | None = None

    @classmethod
    def of(cls, problem: Problem, links: tuple[LinkRecord, ...] = ()) -> ProblemRecord:
        """The record of a problem."""
        return cls(
            name=problem.name,
            space=problem.task.space,
            shape=problem.object.shape,
            axes=tuple(problem.space.coordinates[i] for i in problem.axes),
            resolution=problem.ellipsoid.resolution,
            torque_scaling=problem.ellipsoid.torque_scaling,
            obstacles=problem.obstacles,
            links=links,
            file=None if problem.source is None else str(problem.source),
        )


class JointRecord(Record):
    """Limits of a joint; null where it has none.

    Attributes:
        lower: rad or m, ``joint_margin`` kept; ``upper`` alike. One that is held has both alike.
        velocity: rad/s or m/s.
        acceleration: rad/s² or m/s².
        torque: N·m or N.
    """

    lower: Finite | None
    upper: Finite | None
    velocity: Finite | None
    acceleration: Finite | None
    torque: Finite | None


class Solution(Displayed, Record):
    """A result; written by `copose solve` as ``result.json``.

    Attributes:
        limits: of every joint, by arm, in the order of ``joint_names``.
        unlimited: the revolute joints without limits, which are the same after a whole turn.
        freedom: what was free beside the joints.
        cases: in place of ``after``, the postures of the file's cases, in its order; ``before``
            stands then in ``cases_before``.
        reachable_from_start: whether the arms can move from ``before`` to ``after`` without letting
            go and without moving the object; null where that was not asked or cannot be said.
    """

    format: Literal[1] = 1
    copose: str
    problem: ProblemRecord
    status: Literal["solved", "infeasible", "failed"]
    reason: str | None
    notes: tuple[str, ...]
    objective: ObjectiveRecord
    joint_names: dict[str, tuple[str, ...]]
    before: Posture | None
    after: Posture | None
    nearest_miss: Posture | None = None
    search: SearchRecord | None
    timing: Timing
    limits: dict[str, tuple[JointRecord, ...]] = Field(default_factory=dict)
    unlimited: dict[str, tuple[str, ...]]
    freedom: tuple[FreeRecord, ...] = ()
    cases: tuple[CasePosture, ...] | None = None
    cases_before: tuple[CasePosture, ...] | None = None
    reachable_from_start: bool | None = None

    @property
    def q_names(self) -> tuple[str, ...]:
        """``arm/joint`` of every entry of a posture's ``q``."""
        return arrays.q_names(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """Joint positions, rad or m: a row a joint, columns ``before`` and ``after``, or the cases.

        Raises:
            InputError: pandas is not installed.
        """
        return arrays.solution_frame(self)

    def to_xarray(self) -> xarray.Dataset:
        """The same as ``q``, by posture and joint.

        Raises:
            InputError: xarray is not installed.
        """
        return arrays.solution_dataset(self)

    @model_serializer(mode="wrap")
    def _without_empty_keys(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        data: dict[str, object] = handler(self)
        for key in ("nearest_miss", "freedom", "cases", "cases_before"):
            if not data[key]:
                del data[key]
        return data
