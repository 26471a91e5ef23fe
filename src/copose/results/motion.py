"""Motions: the result of a path as frozen data, the same as in `result.json`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from copose.display import Displayed
from copose.poses import Array
from copose.results import arrays
from copose.results.evidence import BasinRecord
from copose.results.posture import Posture
from copose.results.records import Finite, Record, Vector
from copose.results.solution import JointRecord, ObjectiveRecord, ProblemRecord, Timing

if TYPE_CHECKING:
    import pandas
    import xarray


class Knot(Posture):
    """A posture of a motion.

    Attributes:
        objective: its value; null where there is none.
        velocity: of the joints, by arm, rad/s or m/s.
        acceleration: alike, rad/s² or m/s².
        torque: that drives the joints so, by arm, N·m or N; null in all knots where at one of them
            no contact wrenches carry the object.
    """

    objective: Finite | None
    velocity: dict[str, Vector]
    acceleration: dict[str, Vector]
    torque: dict[str, Vector] | None


class TrackingRecord(Record):
    """Least-norm tracking of the same path from the first posture: what is there without planning.

    Attributes:
        objective: at every time of the motion; null from where on it fails.
        reason: why it fails, null where it does not.
    """

    objective: tuple[Finite | None, ...]
    reason: str | None


class RouteRecord(Record):
    """A route of the layered graph that was optimised.

    Attributes:
        graph: its aggregate less smoothness in the graph.
        value: the same of the motion that the program made of it; null where that failed.
        status: how the program ended, in IPOPT's words.
    """

    graph: Finite
    value: Finite | None
    status: str


class PathSearchRecord(Record):
    """The evidence of a path's search.

    Attributes:
        seed: of everything that was drawn.
        layers: of the graph.
        nodes: postures in it, by arm.
        combinations: of the arms' postures that were evaluated.
        routes: that were optimised, best first.
        basins: of the routes' motions, those of the graph before they are checked between knots.
    """

    seed: int
    layers: int
    nodes: dict[str, int]
    combinations: int
    routes: tuple[RouteRecord, ...]
    basins: BasinRecord | None = None


class Motion(Displayed, Record):
    """A joint motion; written by `copose path` as ``result.json``.

    Attributes:
        objective: aggregates over the knots; ``before`` is least-norm tracking's.
        limits: of every joint, by arm, in the order of ``joint_names``.
        aggregate: of the objective over the knots.
        smoothness: S, the mean of the squared joint speeds, of all intervals and joints.
        duration: s; null where nothing moves.
        time: of the knots, s.
        knots: postures with velocities, accelerations and torques.
        between_knots_error: the largest opening of the chain between knots, m or rad.
        collision: the smallest distance between knots, m, by coal; null where it was not asked for.
        least_norm: what tracking without planning comes to.
        reachable_from_start: of a motion to the best posture, whether that of all is reachable.
    """

    format: Literal[1] = 1
    copose: str
    problem: ProblemRecord
    status: Literal["solved", "infeasible", "failed"]
    reason: str | None
    notes: tuple[str, ...]
    objective: ObjectiveRecord
    aggregate: Literal["mean", "worst"]
    smoothness: Finite | None
    duration: Finite | None
    joint_names: dict[str, tuple[str, ...]]
    limits: dict[str, tuple[JointRecord, ...]]
    time: Vector | None
    knots: tuple[Knot, ...] | None
    between_knots_error: Finite | None
    collision: Finite | None = None
    least_norm: TrackingRecord | None
    reachable_from_start: bool | None = None
    search: PathSearchRecord | None
    timing: Timing

    @property
    def q(self) -> Array:
        """The joint positions of all knots, rad or m, (K, N).

        Raises:
            InputError: nothing moves.
        """
        return arrays.positions(self)

    @property
    def q_names(self) -> tuple[str, ...]:
        """``arm/joint`` of every column of ``q``."""
        return arrays.q_names(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """Joint positions as in `trajectory.csv`: a row a knot, by its time, a column a joint.

        Raises:
            InputError: nothing moves, or pandas is not installed.
        """
        return arrays.motion_frame(self)

    def to_xarray(self) -> xarray.Dataset:
        """``q``, ``velocity``, ``acceleration``, ``torque`` by time and joint, and ``objective``.

        NaN stands where there is none.

        Raises:
            InputError: nothing moves, or xarray is not installed.
        """
        return arrays.motion_dataset(self)
