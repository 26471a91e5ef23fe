"""The planner: solves a problem, follows and measures postures, and traces self-motions."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.errors import InputError
from copose.kernels import one_at_a_time
from copose.measurement.meter import Measures
from copose.objectives.registry import objective_of
from copose.poses import Array
from copose.posture.arguments import (
    Warm,
    arm_called,
    check_epsilon,
    check_seed,
    effort_of,
    postures_of,
    warm_joints,
    warm_placement,
)
from copose.posture.evaluation import stated
from copose.posture.local.local_end import LocalEnd, local_solve
from copose.posture.model import PostureModel
from copose.posture.reachable.components import manifold_of
from copose.posture.run.run import Run
from copose.posture.search.effort import Effort, EffortName
from copose.posture.setting import Setting
from copose.posture.solution import unfound
from copose.problem import Problem, same_structure
from copose.progress import StoppedError, Tell, sheltered, stage, watched
from copose.results import Solution, Timing

if TYPE_CHECKING:
    from copose.posture.landscape.objective_map import Landscape
    from copose.self_motion.curves.self_motion_curve import SelfMotionCurve
    from copose.self_motion.misses.gaps import Followed
    from copose.self_motion.null_space import NullMotion


class Planner:
    """Solves one problem any number of times; everything is built once.

    Where a C compiler is found its kernels are compiled in the background at the first use and
    kept for good; until they are ready CasADi's virtual machine serves, with the same answers.
    Threads may share a planner: they build and solve in turns, and measure at the same time. A
    pickled planner is its problem, from which it is built anew.

    Attributes:
        problem: as read by `copose.load`.
        build_s: seconds that building took.
    """

    @one_at_a_time
    def __init__(self, problem: Problem, *, movable: bool = False) -> None:
        """Build everything that solving needs.

        Args:
            problem: as read by `copose.load`.
            movable: whether the poses of bases and grasps are parameters, too, see `fits`.

        Raises:
            InputError: a robot cannot be used.
        """
        began = time.perf_counter()
        self.problem, self._movable = problem, movable
        self._model = PostureModel(Cell.of(problem, movable=movable))
        self._nominal = self._model.setting(self._model.cell)
        self.build_s = time.perf_counter() - began

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return partial(type(self), movable=self._movable), (self.problem,)

    def fits(self, problem: Problem) -> bool:
        """True where this planner can solve a problem in place of its own, without building anew.

        It may differ in the object's pose, mass and inertia, in directions, and, where the planner
        is built ``movable``, in grasps, and in bases where neither bodies nor contacts have limits.
        """
        return same_structure(self.problem, problem, movable=self._movable)

    @property
    def spare(self) -> dict[str, int]:
        """Degrees of freedom that each arm has to spare while it holds the object, by name."""
        cell = self._model.cell
        return {arm.name: cell.spare(i) for i, arm in enumerate(cell.arms)}

    def compile(self) -> bool:
        """Wait until the kernels are compiled; true where they are in use then.

        They are not where no compiler is found, or with ``COPOSE_COMPILE=0`` in the environment.
        """
        return self._model.compiled(wait=True)

    @one_at_a_time
    def solve(
        self,
        *,
        problem: Problem | None = None,
        object_pose: Mapping[str, object] | None = None,
        warm: Warm | None = None,
        seed: int | None = None,
        effort: EffortName | Effort = "normal",
        verify: bool = False,
        prove: float | None = None,
        progress: Tell | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """The posture in which the arms accelerate the object best.

        Args:
            problem: in place of the planner's own, see `fits`.
            object_pose: ``position`` and ``rpy`` (in the plane ``angle``) in place of the file's.
            warm: a posture to go on from, or a result whose ``after`` it is: only the local optimum
                that it leads to is sought. Where it cannot follow the object, all is searched.
            seed: in place of the file's.
            effort: how much is searched: ``low``, ``normal`` or ``high``, or an `Effort` with
                options of its own; ``high`` where an arm has more than one degree of freedom to
                spare.
            verify: search again with another seed and twice the effort, all self-motions that
                slices meet among them, and say whether the answer stands.
            prove: ε, from 1e-9 on in the objective's unit: prove that no posture beats the answer
                by more, as ``search.proof`` says; see `copose manual proof`.
            progress: called with a `copose.Progress` as stages begin and the best so far grows.
            time_limit: s; the best found by then is the answer, with a note, or ``failed`` where
                there is none yet. Answers under a limit may differ from run to run.

        Returns:
            A solution whose ``status`` is ``solved``; ``infeasible`` where an arm cannot reach its
            grasp, with the arm and the gap as ``reason`` and the nearest miss; or ``failed``.

        Raises:
            InputError: an argument is not what it should be.
        """
        check_seed(seed)
        check_epsilon(prove)
        tried = effort_of(effort)
        if problem is not None and not self.fits(problem):
            raise InputError("differs in more than parameters; build a planner for it")
        began = time.perf_counter()
        with watched(progress, time_limit):
            with sheltered():
                setting = self._setting(object_pose, problem)
            if seed is None:
                seed = setting.cell.problem.search.seed
            run = Run(self._model, setting, int(seed), self.build_s, began)
            try:
                self._model.compiled()
                return self._answer(run, warm, tried, verify, prove)
            except StoppedError as stop:
                with sheltered():
                    return unfound(setting.cell, setting.objective, stop, run.timing)

    def _answer(
        self, run: Run, warm: Warm | None, effort: Effort, verify: bool, prove: float | None
    ) -> Solution:
        """The answer of a run from a warm posture, if there is one, or of a search."""
        cell = run.cell
        placed = None
        if len(Freedom.of(cell.problem)) > 0 or cell.problem.cases:
            from copose.posture.placement.run import PlacedRun

            placed = PlacedRun(run)
        if warm is not None:
            for key, asked in (("verify", verify), ("prove", prove is not None)):
                if asked:
                    raise InputError(
                        "searches everything; from a warm posture one local optimum is sought",
                        key=key,
                    )
            solution = (
                run.follow(cell.given(warm_joints(warm)))
                if placed is None
                else placed.follow(warm_placement(cell, warm))
            )
            if solution is not None:
                return solution
        if placed is None:
            return run.search(effort, verify, prove)
        return placed.search(effort, verify, prove)

    @one_at_a_time
    def polish(
        self,
        joints: Mapping[str, ArrayLike],
        *,
        object_pose: Mapping[str, object] | None = None,
    ) -> LocalEnd:
        """The local optimum that a posture leads to, and nothing but it: for tight loops.

        Where the objective has kinks, or torque limits matter, it is one run of IPOPT.

        Args:
            joints: a posture to start from, by arm; it is closed first.
            object_pose: as for `solve`.

        Raises:
            InputError: the joints do not fit the arms.
        """
        self._model.compiled()
        setting = self._setting(object_pose)
        return local_solve(self._model, setting, setting.cell.given(joints))

    def _setting(
        self, object_pose: Mapping[str, object] | None, problem: Problem | None = None
    ) -> Setting:
        if object_pose is None and problem is None:
            return self._nominal
        cell = self._model.cell
        cell = cell if problem is None else cell.at(problem)
        return self._model.setting(cell if object_pose is None else cell.moved(object_pose))

    @one_at_a_time
    def follow(
        self, joints: Mapping[str, Sequence[float]], *, problem: Problem | None = None
    ) -> Followed:
        """The local optimum that a posture leads to, or by how much arms miss; nothing is searched.

        Args:
            joints: where the arms are, rad or m, by arm.
            problem: in place of the planner's own, see `fits`, which is not asked: to be called as
                often as a hand moves. Nothing but joints may be free in it.

        Raises:
            InputError: the joints do not fit the arms.
        """
        from copose.self_motion.misses.gaps import Followed, nearest_gaps

        began = time.perf_counter()
        self._model.compiled()
        setting = self._setting(None, problem)
        q = setting.cell.given(joints)
        run = Run(self._model, setting, setting.cell.problem.search.seed, self.build_s, began)
        solution = run.follow(q)
        if solution is not None:
            return Followed(solution, {})
        goals, lower, upper = setting.placement.goals, setting.lower, setting.upper
        return Followed(None, nearest_gaps(setting.cell, self._model.arms, goals, lower, upper, q))

    @one_at_a_time
    def evaluate(
        self,
        joints: Mapping[str, Sequence[float]],
        *,
        problem: Problem | None = None,
        everything: bool = False,
    ) -> Solution:
        """The measures of a posture, neither projected nor optimised, as ``after``; ``infeasible``
        where it is open or breaks a limit.

        Args:
            joints: rad or m, by arm.
            problem: in place of the planner's own, see `fits`, which is not asked.
            everything: whether what the problem does not ask for is stated, too, see
                `copose.evaluate`.

        Raises:
            InputError: the joints do not fit the arms.
        """
        began = time.perf_counter()
        model = self._model
        setting = self._setting(None, problem)
        cell, objective = setting.cell, setting.objective
        q = cell.given(joints)
        measured = model.measure(setting, q, everything=everything)
        timing = Timing(build_s=self.build_s, search_s=time.perf_counter() - began)
        return stated(cell, objective, q, measured, timing, model.links)

    @one_at_a_time
    def holding_shares(
        self, joints: Mapping[str, Sequence[float]], *, problem: Problem | None = None
    ) -> dict[str, Array] | None:
        """Share of each joint's torque limit, by arm (n_i,), in the hold at rest whose largest
        share is smallest; None where a joint has no limit or nothing holds the object.

        Args:
            joints: rad or m, by arm.
            problem: in place of the planner's own, see `fits`, which is not asked.

        Raises:
            InputError: the joints do not fit the arms.
        """
        cell = self._setting(None, problem).cell
        shares = self._model.meter.holding_shares(cell, cell.given(joints))
        return None if shares is None else {name: np.array(share) for name, share in shares.items()}

    def measure(
        self,
        postures: Mapping[str, ArrayLike],
        *,
        object_pose: Mapping[str, object] | None = None,
    ) -> Measures:
        """Measures of many postures.

        Args:
            postures: joint positions by arm, rad or m, (count, n_i) each.
            object_pose: as for `solve`.

        Raises:
            InputError: the postures do not fit the arms.
        """
        self._model.compiled()
        setting = self._setting(object_pose)
        return self._model.measures(setting, postures_of(setting.cell, postures))

    @one_at_a_time
    def self_motion(
        self,
        joints: Mapping[str, ArrayLike],
        arm: str,
        *,
        problem: Problem | None = None,
        known: SelfMotionCurve | None = None,
    ) -> SelfMotionCurve:
        """All postures that an arm comes to while the object stands still, and what they are worth.

        Args:
            joints: a posture that holds the object, by arm.
            arm: one with one degree of freedom to spare.
            problem: in place of the planner's own, see `fits`, which is not asked.
            known: what an earlier call has given at this pose: while the arm is on it only values
                are computed anew, which takes a fraction of the time.

        Raises:
            InputError: it has another number, or an arm does not hold the object.
        """
        from copose.posture.landscape.curve_values import self_motions

        setting, q = self._posture_of(joints, problem)
        which, before = [arm_called(self._model.cell, arm)], () if known is None else (known,)
        seed = self.problem.search.seed
        return self_motions(self._model, setting, q, which, seed, before)[0]

    @one_at_a_time
    def landscape(
        self,
        joints: Mapping[str, ArrayLike],
        first: str,
        second: str,
        *,
        problem: Problem | None = None,
        branches: bool = False,
        known: Landscape | None = None,
    ) -> Landscape:
        """The objective over the self-motions of two arms, the others where they are.

        Args:
            joints: as for `self_motion`.
            first: an arm with one degree of freedom to spare.
            second: another.
            problem: in place of the planner's own, see `fits`, which is not asked.
            branches: map the other pairs of the arms' self-motions too.
            known: as for `self_motion`.

        Raises:
            InputError: as for `self_motion`; or both are one.
        """
        from copose.posture.landscape.objective_map import landscape

        setting, q = self._posture_of(joints, problem)
        arms = arm_called(self._model.cell, first), arm_called(self._model.cell, second)
        if arms[0] == arms[1]:
            raise InputError(f"two arms are needed, not {first!r} twice", key="second")
        before = () if known is None else (known.first, known.second)
        seed = self.problem.search.seed
        return landscape(self._model, setting, q, arms, seed, branches, before)

    @one_at_a_time
    def null_motion(
        self,
        joints: Mapping[str, ArrayLike],
        arm: str,
        direction: int,
        amount: float,
        *,
        basis: ArrayLike | None = None,
        problem: Problem | None = None,
    ) -> NullMotion:
        """Motion of an arm by itself along one of the directions in which it can move so.

        Args:
            joints: a posture that holds the object, by arm.
            arm: one with degrees of freedom to spare, d of them.
            direction: from 0 to d − 1, a row of the basis.
            amount: rad (or m).
            basis: of the null motion before, (d, n), so that directions do not jump; without it the
                posture decides them.
            problem: in place of the planner's own, see `fits`, which is not asked.

        Raises:
            InputError: there is no such direction, or an arm does not hold the object.
        """
        from copose.posture.landscape.branches import held_postures
        from copose.self_motion.null_space import null_basis, null_motion

        setting, q = self._posture_of(joints, problem)
        i = arm_called(self._model.cell, arm)
        spare, shape = setting.cell.spare(i), (setting.cell.spare(i), setting.cell.arms[i].n)
        if not 0 <= direction < spare:
            raise InputError(f"arm {arm!r} has {max(spare, 0)} directions", key="direction")
        manifold = manifold_of(self._model, setting, [i])
        posture = held_postures(self._model, setting, q)[i]
        before = None if basis is None else np.asarray(basis, dtype=float)
        if before is not None and before.shape != shape:
            raise InputError(f"an array of shape {shape} is needed", key="basis")
        spanned = null_basis(manifold, posture, before)
        return null_motion(manifold, posture, direction, amount, spanned)

    def _posture_of(
        self, joints: Mapping[str, ArrayLike], problem: Problem | None
    ) -> tuple[Setting, list[Array]]:
        self._model.compiled()
        setting = self._setting(None, problem)
        return setting, setting.cell.given(joints)


def solve(
    problem: Problem,
    *,
    seed: int | None = None,
    effort: EffortName | Effort = "normal",
    verify: bool = False,
    prove: float | None = None,
    progress: Tell | None = None,
    time_limit: float | None = None,
) -> Solution:
    """The posture in which the arms accelerate the object best: `Planner.solve` of a new planner.

    Raises:
        InputError: a robot cannot be used.
    """
    began = time.perf_counter()
    with watched(progress, time_limit):
        try:
            stage("building")
            planner = Planner(problem)
        except StoppedError as stop:
            with sheltered():
                cell, spent = Cell.of(problem), time.perf_counter() - began
                return unfound(cell, objective_of(cell), stop, Timing(build_s=spent, search_s=0.0))
        return planner.solve(seed=seed, effort=effort, verify=verify, prove=prove)
