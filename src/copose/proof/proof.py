"""The proof that no posture on the arms' self-motions beats the best by more than ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.objectives.objective import Objective
from copose.poses import Array
from copose.progress import stage
from copose.proof.arm_terms import ArmTerms
from copose.proof.combinations import CombinationSearch
from copose.proof.segments import MotionSegments
from copose.proof.self_motions import SelfMotions
from copose.proof.tubes import SelfMotionTubes
from copose.self_motion.kernels import ArmKernels, KernelInputs
from copose.self_motion.slices.sliced_arm import ArmSlices, SlicedArm


def unprovable(cell: Cell, objective: Objective) -> str | None:
    """The reason why nothing can be proved of a problem; None where there is none."""
    problem = cell.problem
    if len(Freedom.of(problem)) or problem.cases:
        return "more than joints is free"
    if not objective.bound_sides(sliced=len(problem.axes) < problem.space.m):
        how = ""
        if objective.form is not None:
            how = f" of {problem.ellipsoid.resolution} ellipsoids on these axes"
        return f"no bound of {objective.kind!r}{how} is known along self-motions"
    fixed = [arm.name for arm in cell.arms if arm.fixed]
    return f"arm {fixed[0]!r} is held at its start" if fixed else None


@dataclass(eq=False)
class Proof:
    """The state of a proof, by arm as far as it came."""

    value: float  # of the best posture known
    epsilon: float  # asked for
    reason: str | None = None  # why it cannot be ended; None where it is, or while it goes on
    slices: list[ArmSlices] = field(default_factory=list)
    motions: list[SelfMotions] = field(default_factory=list)
    segments: list[MotionSegments] = field(default_factory=list)
    search: CombinationSearch | None = None  # None before it begins
    done: bool = False  # whether every combination is ruled out

    def run(
        self,
        cell: Cell,
        kernels: Sequence[ArmKernels],
        inputs: KernelInputs,
        objective: Objective,
        better: Callable[[Sequence[Array]], float | None],
    ) -> None:
        """Go as far as it goes; where the call has to end the state is what is known.

        Args:
            cell: with the object where it is.
            kernels: of the arms.
            inputs: of these, for the object's placement.
            objective: which is maximised.
            better: see `CombinationSearch.run`.

        Raises:
            StoppedError: the call has to end.
        """
        self.reason = unprovable(cell, objective)
        known: dict[ArmKernels, SlicedArm] = {}
        for i, (arm, model) in enumerate(zip(cell.arms, kernels, strict=True)):
            if self.reason is not None:
                return
            stage(f"slicing the self-motions of arm {arm.name}", i, len(cell.arms))
            if model not in known:
                known[model] = SlicedArm(arm, model, cell.system.space)
            self.reason = self._enclosed(cell, i, known[model], inputs, objective)
        if self.reason is not None:
            return
        M_o, axes = np.zeros([cell.system.space.m] * 2), list(cell.problem.axes)
        M_o[np.triu_indices(len(M_o))] = inputs.inertia
        M_o = np.triu(M_o, 1).T + M_o
        self.search = CombinationSearch(
            self.segments, lambda corners: objective.upper_bounds(corners, M_o[np.ix_(axes, axes)]),
            self.value, self.epsilon,
        )  # fmt: skip
        self.done = self.search.run(better)
        self.value = self.search.best
        if not self.done:
            self.reason = "that takes more combinations of segments, or less rounding"

    def _enclosed(
        self, cell: Cell, i: int, sliced: SlicedArm, inputs: KernelInputs, objective: Objective
    ) -> str | None:
        """Slice and bound all self-motions of arm i; why that cannot be done, or None."""
        arm, space, axes, form = cell.arms[i], cell.system.space, cell.problem.axes, objective.form
        if sliced.fault is not None or form is None:
            return f"arm {arm.name!r} {sliced.fault}"
        self.slices.append(sliced.at(inputs.goals[i]))
        motions = SelfMotions.of(cell, sliced.kernels, i, inputs.goals[i], self.slices[-1])
        self.motions.append(motions)
        stage(f"enclosing the self-motions of arm {arm.name}", i, len(cell.arms))
        sides = objective.bound_sides(sliced=len(axes) < space.m)
        terms = ArmTerms(SelfMotionTubes(arm, space, inputs.goals[i]), form, inputs.ties[i])
        segments = MotionSegments(cell, i, terms, motions.manifold, sides)
        segments.add(motions.pieces)
        self.segments.append(segments)
        return (
            f"arm {arm.name!r} passes a singular posture"
            if segments.lost or motions.ended
            else None
        )
