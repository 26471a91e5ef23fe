"""From a problem to its best posture."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from copose.errors import InputError, nearest
from copose.planning.answering import answer
from copose.planning.cell import Cell
from copose.planning.closing import CLOSED, project
from copose.planning.machinery import Machinery, Setting
from copose.planning.measuring import Measurement, Measures
from copose.planning.missing import misses
from copose.planning.notes import margin_notes
from copose.planning.search import EFFORTS, Found, LocalOptimum, Progress, local_search, search
from copose.poses import Array
from copose.problem import Problem
from copose.results import (
    FailureRecord,
    Optimum,
    SampleRecord,
    SearchRecord,
    Solution,
    Timing,
    VerificationRecord,
)

EffortName: TypeAlias = Literal["low", "normal", "high"]

# What a returned posture may miss its grasp by, m or rad.
CLOSURE_TOLERANCE = 1e-8
_STANDS = 1e-6
_NUDGES = 8


@dataclasses.dataclass(frozen=True, eq=False)
class LocalEnd:
    """Where a local solve ended.

    Attributes:
        joints: rad or m, by arm.
        objective: there.
        optimality: scaled error of the optimality conditions, as IPOPT measures it.
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

    Attributes:
        problem: as read by `copose.load`.
        build_s: seconds that building took.
    """

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

    def compile(self) -> bool:
        """Wait until the kernels are compiled; whether they are in use then.

        They are not where no compiler is found, or with ``COPOSE_COMPILE=0`` in the environment.
        """
        return self._machinery.compiled(wait=True)

    def solve(
        self,
        *,
        object_pose: Mapping[str, object] | None = None,
        warm: Solution | Mapping[str, Sequence[float]] | None = None,
        seed: int | None = None,
        effort: EffortName = "normal",
        verify: bool = False,
        progress: Progress | None = None,
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
            progress: called with what is being done and the fraction of the whole behind.

        Returns:
            A solution whose ``status`` is ``solved``; ``infeasible`` where an arm cannot reach its
            grasp, with the arm and the gap as ``reason`` and the nearest miss; or ``failed``.

        Raises:
            InputError: an argument is not what it should be.
        """
        if seed is not None and not (isinstance(seed, int) and 0 <= seed < 2**63):
            raise InputError(f"{seed!r} is no whole number from 0 to 2⁶³ − 1", key="seed")
        if effort not in get_args(EffortName):
            raise InputError(f"{effort!r} is not low, normal or high", key="effort")
        began = time.perf_counter()
        machinery = self._machinery
        machinery.compiled()
        setting = self._setting(object_pose)
        run = _Run(
            machinery=machinery,
            setting=setting,
            seed=self.problem.search.seed if seed is None else seed,
            build_s=self.build_s,
            began=began,
            progress=progress if progress is not None else _silent,
        )
        if warm is not None:
            if verify:
                raise InputError(
                    "searches everything; from a warm posture one local optimum is sought",
                    key="verify",
                )
            solution = run.follow(setting.cell.given(_posture(warm)))
            if solution is not None:
                return solution
        return run.search(effort, verify)

    def polish(
        self,
        joints: Mapping[str, ArrayLike],
        *,
        object_pose: Mapping[str, object] | None = None,
    ) -> LocalEnd:
        """The local optimum that a posture leads to, and nothing but it: for tight loops.

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
        polished = machinery.polisher(setting).polish(np.hstack(q))
        parts = cell.system.split(polished.q[0])
        return LocalEnd(
            joints={arm.name: cell.folded(i, q) for (i, arm), q in
                    zip(enumerate(cell.arms), parts, strict=True)},
            objective=float(machinery.objectives(setting, polished.q)[0]),
            optimality=float(polished.error[0]),
            converged=bool(polished.converged[0] and max(gaps) <= CLOSED and machinery.smooth),
        )  # fmt: skip

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
    effort: EffortName = "normal",
    verify: bool = False,
    progress: Progress | None = None,
) -> Solution:
    """The posture in which the arms accelerate the object best: `Planner.solve` of a new planner.

    Raises:
        InputError: a robot cannot be used.
    """
    if progress is not None:
        progress("building", 0.0)
    return Planner(problem).solve(effort=effort, verify=verify, progress=progress)


def _silent(what: str, done: float) -> None:
    """No one asked to be told."""


def _posture(warm: Solution | Mapping[str, Sequence[float]]) -> Mapping[str, Sequence[float]]:
    if not isinstance(warm, Solution):
        return warm
    if warm.after is None:
        raise InputError("has no posture: its after is null", key="warm")
    return warm.after.joints


@dataclasses.dataclass(frozen=True, eq=False)
class _Run:
    """One answer in the making."""

    machinery: Machinery
    setting: Setting
    seed: int
    build_s: float
    began: float
    progress: Progress

    @property
    def cell(self) -> Cell:
        return self.setting.cell

    @property
    def timing(self) -> Timing:
        return Timing(
            build_s=self.build_s,
            search_s=time.perf_counter() - self.began,
            kernels="compiled" if self.machinery.compiled_already else "virtual machine",
        )

    def search(self, effort: EffortName, verify: bool) -> Solution:
        """Search everything."""
        cell, objective = self.cell, self.machinery.objective
        found = search(self.machinery, self.setting, self.seed, EFFORTS[effort], self.progress)
        if any(len(sample.closed) == 0 for sample in found.samples):
            joints, reason = misses(cell, found.samples)
            return answer(
                cell,
                objective,
                status="infeasible",
                reason=reason,
                miss=self.machinery.meter.measure(cell, joints),
                search=self._record(found, self.seed, effort, None),
                timing=self.timing,
            )
        before, notes = self._before(found)
        after, value = self._best(found, before)
        verification = None
        if verify and value is not None:
            verification, better = self._verified(effort, value)
            if better is not None:
                found = better
                after, value = self._best(found, before)
        return answer(
            cell,
            objective,
            status="failed" if after is None else "solved",
            reason=self._why(found, before) if after is None else None,
            notes=(*notes, *_verdict(verification)),
            before=before,
            after=after,
            search=self._record(
                found,
                self.seed if verification is None or verification.stands else verification.seed,
                effort,
                value,
                verification,
            ),
            timing=self.timing,
        )

    def follow(self, joints: Sequence[Array]) -> Solution | None:
        """The local optimum that a posture leads to; None where it cannot be closed."""
        closed = [self._closed(i, q) for i, q in enumerate(joints)]
        q = [mine for mine in closed if mine is not None]
        if len(q) < len(closed):
            return None
        found = local_search(self.machinery, self.setting, np.concatenate(q), self.progress)
        before = self.machinery.meter.measure(self.cell, q)
        after, value = self._best(found, before)
        if after is None:
            return None
        return answer(
            self.cell,
            self.machinery.objective,
            status="solved",
            before=before,
            after=after,
            search=self._record(found, self.seed, "local", value),
            timing=self.timing,
        )

    def _closed(self, i: int, q: Array, *, as_given: bool = False) -> Array | None:
        """Joints of arm i as they are where they hold the object, else projected, or None.

        Args:
            i: the arm.
            q: joint positions, (n,).
            as_given: even where they are nearer to a limit than the margin allows.
        """
        kernels, cell, goal = self.machinery.arms[i], self.cell, self.setting.placement.goals[i]
        lower, upper = cell.lower[i], cell.upper[i]
        residual, _ = kernels.residual(q[None], goal)
        if np.linalg.norm(residual) <= CLOSED:
            folded = q if as_given else cell.folded(i, q)
            if as_given or np.all((folded >= lower) & (folded <= upper)):
                return folded
        end, gap = project(kernels, q[None], goal, lower, upper)
        if gap[0] <= CLOSED:
            return np.asarray(end[0])
        # A stretched arm has no slope to follow; from a little beside it there is one.
        nudges = np.random.default_rng(0).normal(size=(_NUDGES, len(q)))
        beside = q + nudges * np.geomspace(1e-3, 0.1, _NUDGES)[:, None]
        ends, gaps = project(kernels, beside, goal, lower, upper)
        closed = np.flatnonzero(gaps <= CLOSED)
        return np.asarray(ends[closed[0]]) if len(closed) else None

    def _before(self, found: Found) -> tuple[Measurement, tuple[str, ...]]:
        """The start of the file, closed, or the first closed posture that the seed gives."""
        joints, notes = [], []
        for i, (arm, sample) in enumerate(zip(self.cell.arms, found.samples, strict=True)):
            q = sample.closed[0]
            if arm.start is not None:
                q = self._closed(i, arm.start, as_given=True)
            if q is None:
                q = sample.closed[0]
                notes.append(
                    f"the start of arm {arm.name!r} could not be projected onto its grasp; the "
                    "first closed posture of the seed stands in for it"
                )
            joints.append(q)
        measured = self.machinery.meter.measure(self.cell, joints)
        return measured, (*notes, *margin_notes(self.cell, joints))

    def _best(
        self, found: Found, before: Measurement | None
    ) -> tuple[Measurement | None, float | None]:
        """The best optimum that passes its own check, or the start where none is better."""
        cell, value = self.cell, self.machinery.objective.of
        best = None
        for optimum in found.optima:
            joints = [self._closed(i, q) for i, q in enumerate(cell.system.split(optimum.q))]
            if any(q is None for q in joints):
                continue
            measured = self.machinery.meter.measure(cell, [q for q in joints if q is not None])
            if (
                measured.ellipsoid is not None
                and max(measured.posture.closure_error.values()) <= CLOSURE_TOLERANCE
                and abs(value(measured.ellipsoid) - optimum.objective) <= 1e-6
            ):
                best = measured
                break
        if before is not None and before.ellipsoid is not None and self._allowed(before):
            start = value(before.ellipsoid)
            if best is None or best.ellipsoid is None or start > value(best.ellipsoid):
                best = before if best is not None else None
        if best is None or best.ellipsoid is None:
            return None, None
        return best, value(best.ellipsoid)

    def _allowed(self, measured: Measurement) -> bool:
        joints = measured.posture.joints
        return all(
            np.all((np.array(joints[arm.name]) >= low) & (np.array(joints[arm.name]) <= high))
            for arm, low, high in zip(self.cell.arms, self.cell.lower, self.cell.upper, strict=True)
        )

    def _verified(
        self, effort: EffortName, value: float
    ) -> tuple[VerificationRecord, Found | None]:
        """A second search, and what it found where that is better."""
        seed = int(np.random.SeedSequence([self.seed, 1]).generate_state(1)[0])
        again = search(self.machinery, self.setting, seed, EFFORTS[effort].doubled(), self.progress)
        best: LocalOptimum | None = again.optima[0] if again.optima else None
        stands = best is None or best.objective <= value + _STANDS
        record = VerificationRecord(
            seed=seed, objective=best.objective if best is not None else None, stands=stands
        )
        return record, None if stands else again

    def _record(
        self,
        found: Found,
        seed: int,
        effort: str,
        value: float | None,
        verification: VerificationRecord | None = None,
    ) -> SearchRecord:
        ways = [end.status for end in found.failures]
        gained = value is not None and found.best_sample is not None
        return SearchRecord(
            seed=seed,
            effort=effort,
            samples={
                arm.name: SampleRecord(
                    tried=sample.tried, closed=len(sample.closed), branches=sample.branches
                )
                for arm, sample in zip(self.cell.arms, found.samples, strict=False)
            },
            combinations=found.combinations,
            best_sample=found.best_sample,
            gap=value - found.best_sample if gained else None,  # type: ignore[operator]
            starts=found.starts,
            local_optima=tuple(Optimum(objective=o.objective, count=o.count) for o in found.optima),
            failures=tuple(
                FailureRecord(status=way, count=ways.count(way)) for way in sorted({*ways})
            ),
            verification=verification,
        )

    def _why(self, found: Found, before: Measurement) -> str:
        if before.ellipsoid is None and before.notes:
            return before.notes[0]
        if not found.failures:
            return "no local optimum passed its own check of closure and objective"
        units = {
            constraint.name: constraint.unit for constraint in self.machinery.program.constraints
        }
        worst = [
            f"{name} {violation:.1e} {units[name]}"
            for name, violation in found.failures[0].violations.items()
            if violation > CLOSURE_TOLERANCE
        ]
        return f"no local solve converged: {found.failures[0].status} {', '.join(worst)}".strip()


def _verdict(verification: VerificationRecord | None) -> tuple[str, ...]:
    if verification is None or verification.stands:
        return ()
    return (
        "the first search missed this posture; the second, with twice the effort and seed "
        f"{verification.seed}, found it",
    )
