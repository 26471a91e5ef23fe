"""Solutions: a result as frozen data, the same as in `result.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_serializer
from pydantic_core.core_schema import SerializerFunctionWrapHandler

from copose.collision import Solid, link_outlines
from copose.display import Displayed
from copose.problem import Obstacle, PlanarObstacle, Problem, Shape, SpaceName
from copose.results import arrays
from copose.results.evidence import SearchRecord
from copose.results.posture import CasePosture, Posture
from copose.results.records import Finite, Matrix, Record, matrix
from copose.robots import Arm

if TYPE_CHECKING:
    import pandas
    import xarray


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
    """The problem that was solved, with what a picture of it needs.

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
        """Joint positions as ``q``, by posture and joint.

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
