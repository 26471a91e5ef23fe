"""Acceptance of postures: projection onto the closure, the checks of an answer, and the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.cell.cell import Cell
from copose.cell.notes import margin_notes
from copose.measurement.meter import Measurement
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.setting import Setting
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSample


@dataclass(frozen=True)
class AcceptanceOptions:
    """Tolerances of an answer and of a start."""

    closure: float = 1e-8  # m or rad, by which an answer may miss its grasp
    start_closure: float = 1e-6  # the same of a start without a note, as `evaluate` takes it
    objective: float = 1e-6  # relative, between the objective measured and the search's
    nudges: int = 8  # random steps beside a posture from which it is projected again
    smallest_nudge: float = 1e-3  # rad or m
    largest_nudge: float = 0.1  # rad or m


@dataclass(frozen=True, eq=False)
class Acceptance:
    """The checks that a posture must pass to be an answer where the object is."""

    model: PostureModel
    setting: Setting
    options: AcceptanceOptions = AcceptanceOptions()

    @property
    def cell(self) -> Cell:
        """The cell with its object where it is."""
        return self.setting.cell

    def closed(self, i: int, q: Array, *, as_given: bool = False) -> Array | None:
        """Joints of arm i as they are where they hold the object, else projected, or None.

        Args:
            i: the arm.
            q: joint positions, (n,).
            as_given: even where they are nearer to a limit than the margin allows.
        """
        kernels, cell, goal = self.model.arms[i], self.cell, self.setting.placement.goals[i]
        lower, upper, options = cell.lower[i], cell.upper[i], self.options
        residual, _ = kernels.residual(q[None], goal)
        if np.linalg.norm(residual) <= CLOSED:
            folded = q if as_given else cell.folded(i, q)
            if as_given or np.all((folded >= lower) & (folded <= upper)):
                return folded
        end, gap = project(kernels, q[None], goal, lower, upper)
        if gap[0] <= CLOSED:
            return np.asarray(end[0])
        # A stretched arm has no slope to follow; from a little beside it there is one.
        nudges = np.random.default_rng(0).normal(size=(options.nudges, len(q)))
        sizes = np.geomspace(options.smallest_nudge, options.largest_nudge, options.nudges)
        ends, gaps = project(kernels, q + nudges * sizes[:, None], goal, lower, upper)
        closed = np.flatnonzero(gaps <= CLOSED)
        return np.asarray(ends[closed[0]]) if len(closed) else None

    def all_closed(self, q: Sequence[Array], *, as_given: bool = False) -> list[Array] | None:
        """Joints of all arms, (n_i,) each, as `closed` gives them; None where one is open."""
        parts = [self.closed(i, part, as_given=as_given) for i, part in enumerate(q)]
        closed = [part for part in parts if part is not None]
        return closed if len(closed) == len(parts) else None

    def start(self, i: int) -> tuple[Array | None, tuple[str, ...]]:
        """Joints of arm i at its start, and a note where they are not the file's.

        Joints are None where the file gives no start or it does not close.
        """
        arm, cell, kernels = self.cell.arms[i], self.cell, self.model.arms[i]
        if arm.start is None:
            return None, ()
        gap = kernels.gap(arm.start[None], self.setting.placement.goals[i])[0]
        angle = 2 * np.arctan2(np.linalg.norm(gap[4:]), abs(gap[3]))
        distance = float(np.linalg.norm(gap[:3]))
        rigid = cell.system.space.rigid
        turned = f" and {round(np.degrees(angle), 6):.3g}°" if rigid else ""
        missed = (
            f"the start of arm {arm.name!r} misses its grasp by {round(distance, 9):.3g} m{turned}"
        )
        q = self.closed(i, arm.start, as_given=True)
        if q is None:
            return None, (
                f"{missed} and could not be projected onto it; the first closed posture of the "
                "seed stands in for it",
            )
        if max(distance, angle if rigid else 0.0) <= self.options.start_closure:
            return q, ()
        moved = np.abs(cell.nearest_turn(i, q - arm.start))
        joint = arm.joints[int(moved.argmax())]
        unit = "rad" if joint.kind == "revolute" else "m"
        return q, (
            f"{missed}: it was projected onto it (check start and grasp), which moved the joints "
            f"by up to {moved.max():.3g} {unit} ({joint.name})",
        )

    def before(self, samples: Sequence[ArmSample]) -> tuple[Measurement, tuple[str, ...]]:
        """The start of the file, closed, or the first closed posture that the seed gives."""
        joints: list[Array] = []
        notes: list[str] = []
        for i, sample in enumerate(samples):
            q, start_notes = self.start(i)
            notes += start_notes
            joints.append(sample.closed[0] if q is None else q)
        measured = self.model.measure(self.setting, joints)
        return measured, (*notes, *margin_notes(self.cell, joints))

    def sound(self, measured: Measurement) -> bool:
        """True where a posture has an objective and every chain is closed."""
        error = max(measured.posture.closure_error.values())
        return measured.value is not None and error <= self.options.closure

    def confirmed(self, value: float | None, objective: float) -> bool:
        """True where a measured value is the objective that a search states."""
        if value is None:
            return False
        return abs(value - objective) <= self.options.objective * max(1.0, abs(value))

    def kept(self, measured: Measurement) -> bool:
        """True where a posture keeps the constraints, as far as they are measured."""
        constraints = self.model.feasibility.constraints
        return all(constraint.kept(measured.posture) for constraint in constraints)

    def allowed(self, measured: Measurement) -> bool:
        """True where a posture keeps limits and margins, and the constraints."""
        joints, cell = measured.posture.joints, self.cell
        return self.kept(measured) and all(
            np.all((np.array(joints[arm.name]) >= low) & (np.array(joints[arm.name]) <= high))
            for arm, low, high in zip(cell.arms, cell.lower, cell.upper, strict=True)
        )

    def overlap(self, measured: Measurement | None) -> tuple[str, ...]:
        """A note where bodies of an answer overlap that nothing keeps apart, or on their shapes."""
        if self.model.bodies is not None:
            return self.model.scene.notes
        if measured is None:
            return ()
        joints = [np.array(q) for q in measured.posture.joints.values()]
        return self.model.overlap(self.cell, joints)
