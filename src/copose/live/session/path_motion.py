"""The motion along the path of a session: planning, postures at instants, and saving."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from copose.errors import InputError
from copose.formats import trajectory_csv
from copose.live.problem_file.document import place
from copose.live.session.session import Session
from copose.live.session.state import State
from copose.motion import plan
from copose.motion.curve.hermite import hermite_points
from copose.motion.path.object_motion import ObjectMotion, waypoint_poses
from copose.poses import Array, Pose
from copose.posture import Planner
from copose.problem import Problem, moved
from copose.progress import Tell
from copose.results import Knot, Motion, Posture, Solution, to_json, write_file


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A planned motion, between its knots too."""

    problem: Problem  # the problem of its path
    motion: Motion  # the motion, with knots
    planner: Planner  # a planner for the problem's structure

    @property
    def duration(self) -> float:
        """Its duration, s."""
        return float(self.motion.duration or 0.0)

    @cached_property
    def knots(self) -> tuple[Knot, ...]:
        """Its knots."""
        return self.motion.knots or ()

    @cached_property
    def time(self) -> Array:
        """Times of the knots, s, (n,)."""
        return np.array(self.motion.time, dtype=float)

    @cached_property
    def values(self) -> Array:
        """The objective at the knots, NaN where there is none, (n,)."""
        return np.array([knot.objective for knot in self.knots], dtype=float)

    @cached_property
    def _journey(self) -> ObjectMotion:
        """The path of the object."""
        return ObjectMotion.of(self.problem)

    @cached_property
    def _rates(self) -> dict[str, Array]:
        """Joint velocities at the knots by arm, (n, n_i)."""
        names = self.motion.joint_names
        return {arm: np.array([knot.velocity[arm] for knot in self.knots]) for arm in names}

    @cached_property
    def _joints(self) -> dict[str, Array]:
        """Joint positions at the knots by arm, (n, n_i)."""
        names = self.motion.joint_names
        return {arm: np.array([knot.joints[arm] for knot in self.knots]) for arm in names}

    def joints(self, time: float) -> dict[str, list[float]]:
        """The arms at an instant: on the cubic Hermite curve between two knots, rad or m."""
        k = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2))
        step = float(self.time[k + 1] - self.time[k])
        part = float(np.clip((time - self.time[k]) / step, 0.0, 1.0)) if step > 0 else 0.0
        two = slice(k, k + 2)
        return {
            arm: hermite_points(q[two], self._rates[arm][two], step, part)[0].tolist()
            for arm, q in self._joints.items()
        }

    def pose(self, time: float) -> Pose:
        """The object at an instant."""
        return self._journey.at(time / self.duration if self.duration > 0 else 0.0).pose

    def solution(self, time: float) -> Solution:
        """The measures at an instant; between knots the chain is open by what the path tolerates,
        so that the posture may be its ``nearest_miss``.
        """
        at = place(self.pose(time), planar=self.problem.space.planar)
        return self.planner.evaluate(self.joints(time), problem=moved(self.problem, at))

    def posture(self, time: float) -> Posture:
        """The arms and the object at an instant; at a knot the motion's record of it."""
        knot = self.knot(time)
        if knot is not None:
            return knot
        told = self.solution(time)
        shown = told.after or told.nearest_miss
        assert shown is not None
        return shown

    def knot(self, time: float) -> Knot | None:
        """The knot at an instant; None between knots."""
        k = int(np.abs(self.time - time).argmin())
        return self.knots[k] if abs(self.time[k] - time) <= 1e-9 else None

    def value(self, time: float) -> float | None:
        """The objective at an instant, straight between knots; None where there is none."""
        return self._between(self.values, time)

    def tracked(self, time: float) -> float | None:
        """The objective of least-norm tracking at an instant, alike."""
        record = self.motion.least_norm
        if record is None:
            return None
        return self._between(np.array(record.objective, dtype=float), time)

    def _between(self, values: Array, time: float) -> float | None:
        """A value at an instant, straight between knots; None where there is none."""
        value = float(np.interp(time, self.time, values))
        return value if np.isfinite(value) else None


@dataclass(eq=False)
class PathMotion:
    """The motion of a session along its path; every method belongs to the session's thread."""

    session: Session  # the session; its problem has a path
    course: PlannedMotion | None = None  # the motion that was planned last; None before the first
    message: str = ""  # why there is none, or no newer one; empty if nothing is wrong
    interrupted: bool = False  # whether planning was interrupted the last time
    time: float = 0.0  # the instant that is shown, s

    def plan(self, tell: Tell | None = None) -> bool:
        """Plan the motion of the session's problem, True where there is a new one; else the last
        one stays.
        """
        problem = self.session.state.problem
        try:
            with self.session.watched(tell) as watch:
                motion = plan(problem)
                self.interrupted = watch.interrupted
            planner = self.session.planner()
        except InputError as error:
            self.message, self.interrupted = str(error), False
            return False
        if motion.knots is None:
            why = f"{motion.status}: {motion.reason}"
            self.message = "planning was interrupted" if self.interrupted else why
            return False
        share = self.time / self.course.duration if self.course and self.course.duration else 0.0
        self.course, self.message = PlannedMotion(problem, motion, planner), ""
        # The same place along the path, should it take another time.
        self.time = share * self.course.duration
        return True

    def look(self, time: float) -> Posture:
        """Go to an instant.

        Raises:
            InputError: there is no motion.
        """
        course = self._course()
        self.time = float(np.clip(time, 0.0, course.duration))
        return course.posture(self.time)

    def state(self) -> State:
        """The state of the session with the arms at their postures of the instant.

        Raises:
            InputError: there is no motion.
        """
        told = self._course().solution(self.time)
        return replace(self.session.state, solution=told, shares=None)

    @property
    def stale(self) -> bool:
        """True where the problem asks for another motion by now."""
        course = self.course
        return course is not None and not _same_motion(course.problem, self.session.state.problem)

    def save(self, kind: str, path: Path) -> Path:
        """Write the motion; files of these names are replaced.

        Args:
            kind: motion, for a folder with ``result.json``, ``trajectory.csv`` and ``path.png``; or
                page, for HTML that plays.
            path: the folder, or the file.

        Raises:
            InputError: there is no motion, or the files cannot be written.
        """
        course = self._course()
        if kind == "page":
            from copose.formats import export

            export(course.motion, "html", path, problem=course.problem)
            return path
        from copose.report import draw

        write_file(path / "result.json", to_json(course.motion).encode())
        write_file(path / "trajectory.csv", trajectory_csv(course.motion).encode())
        draw(course.motion, path / "path.png")
        return path

    def _course(self) -> PlannedMotion:
        """The motion that was planned last.

        Raises:
            InputError: there is none.
        """
        if self.course is None:
            raise InputError(self.message or "no motion has been planned")
        return self.course


def _same_motion(one: Problem, other: Problem) -> bool:
    """True where two problems ask for one motion.

    The pose of ``[object]`` counts only where waypoints leave it out.
    """
    if one is other:
        return True
    pose = place(one.object.pose, planar=one.space.planar)
    waypoints = zip(waypoint_poses(one), waypoint_poses(other), strict=False)
    return moved(other, pose) == moved(one, pose) and all(
        np.allclose(a.position, b.position, 0, 1e-12)
        and np.allclose(a.quaternion, b.quaternion, 0, 1e-12)
        for a, b in waypoints
    )
