"""From a problem to its best posture."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from copose.errors import InputError, nearest
from copose.kernels import one_at_a_time
from copose.planning.aims import objective_of
from copose.planning.answering import unfound
from copose.planning.cell import Cell
from copose.planning.closing import CLOSED, project
from copose.planning.freedom import Freedom
from copose.planning.machinery import Machinery, Setting
from copose.planning.measuring import Measures
from copose.planning.placed_answer import PlacedRun
from copose.planning.placing import Placed
from copose.planning.running import EffortName, Run
from copose.poses import Array
from copose.problem import Problem
from copose.progress import StoppedError, Tell, sheltered, stage, watched
from copose.results import Solution, Timing


@dataclass(frozen=True, eq=False)
class LocalEnd:
    """Where a local solve ended.

    Attributes:
        joints: rad or m, by arm.
        objective: there.
        optimality: scaled error of the optimality conditions, as IPOPT measures it; infinite where
            no climb led anywhere better.
        converged: whether that meets IPOPT's tolerance, 1e-9, with every chain closed.
    """

    joints: dict[str, Array]
    objective: float
    optimality: float
    converged: bool


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
    def __init__(self, problem: Problem) -> None:
        """Build everything that solving needs.

        Raises:
            InputError: a robot cannot be used.
        """
        began = time.perf_counter()
        self.problem = problem
        self._machinery = Machinery(Cell.of(problem))
        self._nominal = self._machinery.setting(self._machinery.cell)
        self.build_s = time.perf_counter() - began

    def __reduce__(self) -> tuple[type[Planner], tuple[Problem]]:
        return type(self), (self.problem,)

    def compile(self) -> bool:
        """Wait until the kernels are compiled; whether they are in use then.

        They are not where no compiler is found, or with ``COPOSE_COMPILE=0`` in the environment.
        """
        return self._machinery.compiled(wait=True)

    @one_at_a_time
    def solve(
        self,
        *,
        object_pose: Mapping[str, object] | None = None,
        warm: Solution | Mapping[str, Sequence[float]] | None = None,
        seed: int | None = None,
        effort: EffortName = "normal",
        verify: bool = False,
        progress: Tell | None = None,
        time_limit: float | None = None,
    ) -> Solution:
        """The posture in which the arms accelerate the object best.

        Args:
            object_pose: ``position`` and ``rpy`` (in the plane ``angle``) in place of the file's.
            warm: a posture to go on from, or a result whose ``after`` it is: only the local optimum
                that it leads to is sought. Where it cannot follow the object, all is searched.
            seed: in place of the file's.
            effort: how much is searched; ``high`` where an arm has more than one degree of freedom
                to spare.
            verify: search again with another seed and twice the effort, and say whether the answer
                stands.
            progress: called with a `copose.Progress` as stages begin and the best so far grows.
            time_limit: s; the best found by then is the answer, with a note, or ``failed`` where
                there is none yet. Answers under a limit may differ from run to run.

        Returns:
            A solution whose ``status`` is ``solved``; ``infeasible`` where an arm cannot reach its
            grasp, with the arm and the gap as ``reason`` and the nearest miss; or ``failed``.

        Raises:
            InputError: an argument is not what it should be.
        """
        if seed is not None and not (isinstance(seed, Integral) and 0 <= seed < 2**63):
            raise InputError(f"{seed!r} is no whole number from 0 to 2⁶³ − 1", key="seed")
        if effort not in get_args(EffortName):
            raise InputError(f"{effort!r} is not low, normal or high", key="effort")
        began = time.perf_counter()
        with watched(progress, time_limit):
            with sheltered():
                setting = self._setting(object_pose)
            run = Run(
                machinery=self._machinery,
                setting=setting,
                seed=self.problem.search.seed if seed is None else int(seed),
                build_s=self.build_s,
                began=began,
            )
            try:
                self._machinery.compiled()
                return self._answer(run, warm, effort, verify)
            except StoppedError as stop:
                with sheltered():
                    return unfound(setting.cell, setting.objective, stop, run.timing)

    def _answer(
        self,
        run: Run,
        warm: Solution | Mapping[str, Sequence[float]] | None,
        effort: EffortName,
        verify: bool,
    ) -> Solution:
        """The answer of a run from a warm posture, if there is one, or of a search."""
        cell = run.cell
        free = len(Freedom.of(self.problem)) > 0 or bool(self.problem.cases)
        placed = PlacedRun(run) if free else None
        if warm is not None:
            if verify:
                raise InputError(
                    "searches everything; from a warm posture one local optimum is sought",
                    key="verify",
                )
            solution = (
                run.follow(cell.given(_posture(warm)))
                if placed is None
                else placed.follow(_placed(cell, warm))
            )
            if solution is not None:
                return solution
        return run.search(effort, verify) if placed is None else placed.search(effort, verify)

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
        machinery = self._machinery
        machinery.compiled()
        setting = self._setting(object_pose)
        cell = setting.cell
        q, gaps = [], []
        for i, start in enumerate(cell.given(joints)):
            end, gap = project(
                machinery.arms[i], start[None], setting.placement.goals[i],
                setting.lower[i], setting.upper[i],
            )  # fmt: skip
            q.append(end)
            gaps.append(gap[0])
        start = np.hstack(q)
        if machinery.smooth and not machinery.static:
            polished = machinery.polisher(setting).polish(start)
            end, value, error = polished.q[0], polished.value[0], polished.error[0]
            converged = bool(polished.converged[0])
        else:
            solved = next(machinery.solve_programs(setting, start))
            end, error, converged = solved.q, solved.optimality, solved.converged
            value, kept = machinery.objectives(setting, np.vstack([end, start]))
            if not value >= kept:
                # A step of IPOPT may leave for a worse optimum.
                end, value, error, converged = start[0], kept, np.inf, False
        parts = enumerate(zip(cell.arms, cell.system.split(end), strict=True))
        return LocalEnd(
            joints={arm.name: cell.folded(i, mine) for i, (arm, mine) in parts},
            objective=float(value),
            optimality=float(error),
            converged=bool(converged and max(gaps) <= CLOSED),
        )

    def _setting(self, object_pose: Mapping[str, object] | None) -> Setting:
        if object_pose is None:
            return self._nominal
        return self._machinery.setting(self._machinery.cell.moved(object_pose))

    def measure(
        self,
        postures: Mapping[str, ArrayLike],
        *,
        object_pose: Mapping[str, object] | None = None,
    ) -> Measures:
        """What many postures are worth.

        Args:
            postures: joint positions by arm, rad or m, (count, n_i) each.
            object_pose: as for `solve`.

        Raises:
            InputError: the postures do not fit the arms.
        """
        machinery = self._machinery
        machinery.compiled()
        setting = self._setting(object_pose)
        cell, arrays = setting.cell, []
        if not isinstance(postures, Mapping):
            raise InputError("a mapping from arms to arrays is needed", key="postures")
        for arm in cell.arms:
            try:
                q = np.asarray(postures.get(arm.name, ()), dtype=float)
            except (TypeError, ValueError):
                q = np.zeros(0)
            if q.ndim != 2 or q.shape[1] != arm.n:
                raise InputError(
                    f"an array of shape (count, {arm.n}) is needed, for "
                    + ", ".join(arm.joint_names),
                    key=f"postures.{arm.name}",
                )
            arrays.append(q)
        names = [arm.name for arm in cell.arms]
        for name in postures:
            if name not in names:
                raise InputError(f"no arm is called {name!r}{nearest(name, names)}", key="postures")
        if len({len(q) for q in arrays}) > 1:
            raise InputError("the arms have different numbers of postures", key="postures")
        return machinery.measures(setting, arrays)


def solve(
    problem: Problem,
    *,
    seed: int | None = None,
    effort: EffortName = "normal",
    verify: bool = False,
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
        return planner.solve(seed=seed, effort=effort, verify=verify)


def _placed(cell: Cell, warm: Solution | Mapping[str, Sequence[float]]) -> Placed:
    """Where a result, or a posture at the file's pose, has everything that is free."""
    cases, freedom, problem = cell.cases, Freedom.of(cell.problem), cell.problem
    if not isinstance(warm, Solution):
        xs = [freedom.nominal] * len(cases)
        joints: list[Mapping[str, Sequence[float]]] = [warm] * len(cases)
    else:
        postures = warm.cases if warm.cases is not None else (warm.after,)
        joints = [posture.joints for posture in postures if posture is not None]
        if len(joints) != len(cases):
            raise InputError("has no posture: its after is null", key="warm")
        names = [case.name for case in problem.cases] or [""]
        xs = [freedom.stated(problem, warm, "after", name) for name in names]
    q = [np.concatenate(cell.given(each)) for each in joints]
    return Placed(tuple(xs), tuple(q), -np.inf)


def _posture(warm: Solution | Mapping[str, Sequence[float]]) -> Mapping[str, Sequence[float]]:
    if not isinstance(warm, Solution):
        return warm
    if warm.after is None:
        raise InputError("has no posture: its after is null", key="warm")
    return warm.after.joints
