"""The result of planning a motion, put together from what was found."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from copose.cell.cell import Cell
from copose.cell.notes import extreme_notes, once, standing_notes
from copose.motion.dynamics.least_norm import tracked
from copose.motion.nlp.starts import values_at
from copose.motion.path.knots import Course
from copose.motion.path.object_motion import ObjectMotion
from copose.motion.search.obstruction import Obstruction
from copose.motion.search.refinement import CheckedMotion
from copose.objectives.objective import Objective
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.solution import joint_limits
from copose.problem import PathSpec, Problem
from copose.results import (
    Knot,
    LinkRecord,
    Motion,
    ObjectiveRecord,
    PathSearchRecord,
    ProblemRecord,
    Timing,
    TrackingRecord,
    vector,
)
from copose.version import __version__


@dataclass
class Answer:
    """The parts that all results for one path share."""

    problem: Problem  # as asked
    path: PathSpec  # its ``[path]``
    cell: Cell  # with the arms
    objective: Objective  # what is maximised
    build_s: float  # seconds that building took
    began: float  # when planning did
    compiled: bool = False  # whether compiled kernels are in use
    duration: float = 0.0  # s; where the shortest is sought, the one that is reckoned with
    notes: list[str] = field(default_factory=list)  # what a reader should know
    reachable: bool | None = None  # of a motion to the best posture, whether that can be reached

    def __post_init__(self) -> None:
        """The duration asked for, a second where it is sought."""
        self.duration = 1.0 if self.path.duration == "shortest" else float(self.path.duration)
        if self.problem.object.velocity is not None:
            self.notes.append("object.velocity does not enter: the path says how the object moves")

    def aimed(self, reachable: bool | None) -> None:
        """Note whether the best posture, to which the motion goes, can be reached."""
        self.reachable = reachable
        if reachable is False:
            self.notes.insert(
                0,
                "the best posture of all cannot be reached from the start without letting go: the "
                "motion goes to the best that can",
            )

    def stopped(self, why: Obstruction, search: PathSearchRecord | None) -> Motion:
        """The result without a motion, and why."""
        return self._motion(status=why.status, reason=why.reason, search=search)

    def solved(
        self,
        model: PostureModel,
        journey: ObjectMotion,
        motion: CheckedMotion,
        search: PathSearchRecord,
    ) -> Motion:
        """The result with a motion, measured at every knot."""
        course, duration, q, driven = motion.course, motion.duration, motion.q, motion.driven
        names = [arm.name for arm in self.cell.arms]
        knots, values = [], []
        notes: list[str] = []
        extremes = []
        for k, setting in enumerate(course.settings):
            measured = model.measure(setting, [joints[k] for joints in q])
            posture = measured.posture
            given = {key: getattr(posture, key) for key in posture.model_fields_set}
            values.append(measured.value)
            notes += measured.notes
            extremes.append(measured.extremes)
            knots.append(
                Knot(
                    **given,
                    objective=measured.value,
                    velocity=self._by_arm(names, driven.velocities, k),
                    acceleration=self._by_arm(names, driven.accelerations, k),
                    torque=None
                    if driven.torques is None
                    else self._by_arm(names, driven.torques, k),
                )
            )
        notes += extreme_notes(self.cell, extremes)
        if driven.torques is None and not self.cell.weightless:
            notes.append("no contact wrenches carry the object as it moves: there are no torques")
        step = duration / (len(course) - 1)
        rates = np.diff(np.hstack(q), axis=0) / step
        before, tracking = self._tracked(model, course, journey, q, duration)
        unheeded = self._unheeded()
        if before is not None and unheeded:
            notes.append(f"before, least-norm tracking, does not heed {' and '.join(unheeded)}")
        self.notes += list(dict.fromkeys(notes))
        return self._motion(
            status="solved",
            duration=duration,
            smoothness=float((rates**2).mean()),
            before=before,
            after=self._aggregate(values),
            time=vector(course.phases * duration),
            knots=tuple(knots),
            between_knots_error=motion.error,
            collision=motion.distance,
            least_norm=tracking,
            search=search,
            links=model.links,
        )

    def _unheeded(self) -> list[str]:
        """Limits that the motion keeps and least-norm tracking need not."""
        constraints = self.problem.constraints
        joints = [joint for arm in self.cell.arms for joint in arm.joints]
        kept = {
            "the clearance": constraints.collision,
            "torque limits": constraints.static_torque or self.cell.dynamic_torque,
            "acceleration limits": any(np.isfinite(joint.acceleration) for joint in joints),
        }
        return [name for name, keeps in kept.items() if keeps]

    def _tracked(
        self,
        model: PostureModel,
        course: Course,
        journey: ObjectMotion,
        q: Sequence[Array],
        duration: float,
    ) -> tuple[float | None, TrackingRecord]:
        """The aggregate and record of least-norm tracking from the first posture."""
        first = [joints[0] for joints in q]
        motion = tracked(model, journey, first, len(course), duration)
        known = values_at(model, course, motion.q).tolist()
        values = [value if np.isfinite(value) else None for value in known]
        values += [None] * (len(course) - len(values))
        record = TrackingRecord(objective=tuple(values), reason=motion.reason)
        return self._aggregate(values), record

    def _aggregate(self, values: Sequence[float | None]) -> float | None:
        known = [value for value in values if value is not None]
        if len(known) < len(values):
            return None
        return float(np.min(known) if self.path.aggregate == "worst" else np.mean(known))

    @staticmethod
    def _by_arm(
        names: Sequence[str], parts: Sequence[Array], k: int
    ) -> dict[str, tuple[float, ...]]:
        return {name: vector(part[k]) for name, part in zip(names, parts, strict=True)}

    def _motion(
        self,
        *,
        before: float | None = None,
        after: float | None = None,
        links: tuple[LinkRecord, ...] = (),
        **keys: object,
    ) -> Motion:
        cell, problem, objective = self.cell, self.problem, self.objective
        fields: dict[str, object] = {
            "time": None, "knots": None, "duration": None, "smoothness": None, "reason": None,
            "between_knots_error": None, "least_norm": None,
        }  # fmt: skip
        return Motion.model_validate(
            fields
            | {
                "copose": __version__,
                "problem": ProblemRecord.of(problem, links),
                "notes": once([*standing_notes(cell), *self.notes]),
                "objective": ObjectiveRecord(
                    kind=objective.kind, unit=objective.unit, before=before, after=after
                ),
                "aggregate": self.path.aggregate,
                "reachable_from_start": self.reachable,
                "joint_names": {arm.name: arm.joint_names for arm in cell.arms},
                "limits": joint_limits(cell),
                "timing": Timing(
                    build_s=self.build_s,
                    search_s=time.perf_counter() - self.began,
                    kernels="compiled" if self.compiled else "virtual machine",
                ),
            }
            | keys
        )
