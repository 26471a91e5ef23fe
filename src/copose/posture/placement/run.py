"""One call of a planner where more than joints is free, or where there are cases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.notes import best_so_far
from copose.measurement.meter import Measurement
from copose.poses import Array
from copose.posture.placement.placed import Placed
from copose.posture.placement.search import PlacementOutcome, PlacementSearch
from copose.posture.run.acceptance import Acceptance
from copose.posture.run.certificate import unproved
from copose.posture.run.evidence import (
    blocked_reason,
    failure_records,
    verification_record,
    verification_seed,
    within_limits,
)
from copose.posture.run.run import Run
from copose.posture.search.effort import EFFORTS, Effort
from copose.posture.solution import MeasuredCase, MeasuredCases, Status
from copose.progress import StoppedError, sheltered, stage
from copose.proof.proof import unprovable
from copose.results import (
    BasinRecord,
    Optimum,
    PlacementRecord,
    SampleRecord,
    SearchRecord,
    Solution,
    VerificationRecord,
)
from copose.self_motion.misses.nearest_miss import misses


@dataclass(frozen=True, eq=False)
class PlacedRun:
    """One call of a planner that moves the object, bases or grasps too, or serves several cases.

    Attributes:
        run: of the cell as the file has it.
    """

    run: Run

    def search(self, effort: Effort, verify: bool, epsilon: float | None = None) -> Solution:
        """The best of everything; the best so far where the call has to end.

        With an ε it says why nothing is proved.
        """
        solution = self._best_so_far(effort, verify)
        reason = unprovable(self.run.cell, self.run.model.objective)
        if epsilon is None or reason is None or solution.search is None:
            return solution
        record = solution.search.model_copy(update={"proof": unproved(epsilon, reason)})
        return solution.model_copy(update={"search": record})

    def _best_so_far(self, effort: Effort, verify: bool) -> Solution:
        """The best of everything, or of what is known where the call has to end."""
        search = self._searcher(self.run.seed, effort)
        try:
            return self._searched(search, effort, verify)
        except StoppedError as stop:
            with sheltered():
                outcome = search.so_far
                before, notes = self._before(search, outcome)
                quick = replace(outcome, optima=outcome.optima[: effort.measured])
                after = self._best(search, quick, before)
                if after is None:
                    raise
                notes += (best_so_far(stop),)
                return self._solution(search, outcome, effort.name, before, after, notes)

    def _searcher(self, seed: int, effort: Effort) -> PlacementSearch:
        return PlacementSearch(self.run.model, self.run.cell, seed, effort)

    def _acceptance(self, search: PlacementSearch, k: int, x: Array) -> Acceptance:
        """The checks of case k with everything moved by x, (d,)."""
        return Acceptance(self.run.model, search.setting(k, x))

    def _searched(self, search: PlacementSearch, effort: Effort, verify: bool) -> Solution:
        """The best of everything that a search finds."""
        outcome = search.run()
        before, notes = self._before(search, outcome)
        after = self._best(search, outcome, before)
        verification = None
        if verify and after is not None:
            stage("verifying")
            seed = verification_seed(self.run.seed)
            second = self._searcher(seed, EFFORTS["high"])
            again = second.run()
            better = self._best(second, again, before)
            objective = None if better is None else better.value
            verification = verification_record(seed, objective, after.value)
            if not verification.stands:
                after, outcome = better, again
                notes += ("the first search missed this posture; the second found it",)
        if after is not None:
            for k, (case, x) in enumerate(zip(after.cases, after.free or (), strict=True)):
                notes += self._acceptance(search, k, x).overlap(case.measured)
        return self._solution(search, outcome, effort.name, before, after, notes, verification)

    def follow(self, start: Placed) -> Solution | None:
        """The local optimum that postures of all cases lead to; None where they do not close."""
        search = self._searcher(self.run.seed, EFFORTS["low"])
        closed = self._closed(search, start)
        before = None if closed is None else self._measured(search, closed)
        if closed is None or before is None:
            return None
        outcome = PlacementOutcome((search.polish(closed),), polished=1)
        after = self._best(search, outcome, before)
        if after is None:
            return None
        return self._solution(search, outcome, "local", before, after, ())

    def _closed(self, search: PlacementSearch, placed: Placed) -> Placed | None:
        """A placement with its postures projected onto the closure; None where one is open."""
        joints = []
        for k, (x, q) in enumerate(zip(placed.x, placed.q, strict=True)):
            acceptance = self._acceptance(search, k, x)
            closed = acceptance.all_closed(acceptance.cell.system.split(q))
            if closed is None:
                return None
            joints.append(np.concatenate(closed))
        return replace(placed, q=tuple(joints))

    def _measured(self, search: PlacementSearch, placed: Placed) -> MeasuredCases | None:
        """A closed placement as it is reported; None where a chain is open or a number missing."""
        cases = []
        for k, (x, q) in enumerate(zip(placed.x, placed.q, strict=True)):
            acceptance = self._acceptance(search, k, x)
            setting = acceptance.setting
            measured = self.run.model.measure(setting, setting.cell.system.split(q))
            if not acceptance.sound(measured):
                return None
            cases.append(MeasuredCase(measured, search.weights[k]))
        return MeasuredCases(tuple(cases), placed.x)

    def _best(
        self, search: PlacementSearch, outcome: PlacementOutcome, before: MeasuredCases | None
    ) -> MeasuredCases | None:
        """The best optimum that passes its own check, or the start where none is better."""
        best = next(self._accepted(search, outcome), None)
        if (
            before is not None
            and (best is None or before.value > best.value)
            and all(self.run.acceptance.allowed(case.measured) for case in before.cases)
        ):
            return before
        return best

    def _accepted(
        self, search: PlacementSearch, outcome: PlacementOutcome
    ) -> Iterator[MeasuredCases]:
        """Measurements of those optima that pass their own check, best first."""
        acceptance = self.run.acceptance
        for optimum in outcome.optima:
            closed = self._closed(search, optimum)
            measured = None if closed is None else self._measured(search, closed)
            if (
                measured is not None
                and acceptance.confirmed(optimum.value, measured.value)
                and all(acceptance.kept(case.measured) for case in measured.cases)
            ):
                yield measured

    def _before(
        self, search: PlacementSearch, outcome: PlacementOutcome
    ) -> tuple[MeasuredCases | None, tuple[str, ...]]:
        """The start, or the seed's first posture, at the file's pose clipped into the ranges."""
        xs = search.nominal
        if len(outcome.first) < len(xs):
            return None, ()
        cases, notes = [], list[str]()
        names = self.run.model.places.cases
        for k, (first, name) in enumerate(zip(outcome.first, names, strict=True)):
            if not first.closed:
                return None, ("at the file's pose no posture closes the chain",)
            measured, start_notes = self._acceptance(search, k, xs[k]).before(first.samples)
            case = f"{name}: " if name else ""
            notes += [case + note for note in start_notes]
            cases.append(MeasuredCase(measured, search.weights[k]))
        return MeasuredCases(tuple(cases), xs), tuple(dict.fromkeys(notes))

    def _solution(
        self,
        search: PlacementSearch,
        outcome: PlacementOutcome,
        effort: str,
        before: MeasuredCases | None,
        after: MeasuredCases | None,
        notes: tuple[str, ...],
        verification: VerificationRecord | None = None,
    ) -> Solution:
        """The result of a search, with a reason where there is no answer."""
        value = None if after is None else after.value
        status: Status = "solved"
        reason, miss = None, None
        if after is None:
            status, reason, miss = self._why(search, outcome)
        return self.run.solution(
            status=status,
            search=_search_record(
                self.run.cell, outcome, self.run.seed, effort, value, verification
            ),
            reason=reason,
            notes=notes,
            before=before,
            after=after,
            miss=miss,
        )

    def _why(
        self, search: PlacementSearch, outcome: PlacementOutcome
    ) -> tuple[Status, str, Measurement | None]:
        """Status, reason and the nearest miss of a search that found nothing."""
        model = self.run.model
        wherever, alone = "", outcome.tried == 1
        if not alone:
            wherever = f"; none of {outcome.tried} placements within the free ranges does better"
        settings = [search.setting(k, x) for k, x in enumerate(search.nominal)]
        in_case = [f"in case {name!r} " if name else "" for name in self.run.model.places.cases]
        for setting, first, prefix in zip(settings, outcome.first, in_case, strict=False):
            if not first.closed:
                joints, reason, sure = misses(
                    setting.cell, model.arms, setting.placement.goals, first.samples
                )
                measured = model.measure(setting, joints)
                freedom = Freedom.of(self.run.cell.problem)
                sure &= alone or freedom.never_closes(setting.cell, setting.placement.goals)
                return _status(sure), prefix + reason + wherever, measured
        for first, prefix in zip(outcome.first, in_case, strict=False):
            if first.blocked:
                reason, sure = blocked_reason(first)
                return _status(sure and alone), prefix + reason + wherever, None
        if outcome.closed == 0:
            _, beyond = within_limits(model, settings[0], outcome.first[0], self.run.seed)
            if beyond is not None:
                reason, sure = beyond
                return _status(sure and alone), reason + wherever, None
        ways = [failure.status for failure in failure_records(outcome.failures)]
        return "failed", "no local solve converged: " + ", ".join(ways), None


def _status(sure: bool) -> Status:
    return "infeasible" if sure else "failed"


def _search_record(
    cell: Cell,
    outcome: PlacementOutcome,
    seed: int,
    effort: str,
    value: float | None,
    verification: VerificationRecord | None,
) -> SearchRecord:
    """The record of a search over placements: counts are sums over its searches for postures."""
    best = outcome.best_sample
    optima = tuple(Optimum(objective=o.value, count=o.count) for o in outcome.optima)
    # Where the search had to end its optima may be starts that it did not come to climb from.
    ended = sum(optimum.count for optimum in optima) <= outcome.polished
    samples = {}
    for i, arm in enumerate(cell.arms):
        drawn = [one.samples[i] for one in outcome.searches if len(one.samples) > i]
        branches = [sample.branches for sample in drawn if sample.branches is not None]
        samples[arm.name] = SampleRecord(
            tried=sum(sample.tried for sample in drawn),
            closed=sum(len(sample.closed) for sample in drawn),
            branches=sum(branches) if len(branches) == len(drawn) and drawn else None,
        )
    return SearchRecord(
        seed=seed,
        effort=effort,
        samples=samples,
        combinations=sum(each.combinations for each in outcome.searches),
        best_sample=best,
        gap=None if value is None or best is None else value - best,
        starts=sum(each.starts for each in outcome.searches) + outcome.polished,
        local_optima=optima,
        basins=BasinRecord.of(optima, value) if ended else None,
        failures=failure_records(outcome.failures),
        verification=verification,
        placements=PlacementRecord(
            tried=outcome.tried, closed=outcome.closed, polished=outcome.polished
        ),
    )
