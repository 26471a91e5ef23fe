"""One answer in the making where more than joints is free, or where there are cases."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.notes import best_so_far
from copose.measurement.meter import Measurement
from copose.posture.placement.search import Placed, Placements, PlacementSearch
from copose.posture.run.run import CLOSURE_TOLERANCE, EffortName, Run
from copose.posture.solution import Case, Placing, Status, answer
from copose.progress import StoppedError, sheltered, stage
from copose.results import (
    FailureRecord,
    Optimum,
    PlacementRecord,
    SampleRecord,
    SearchRecord,
    Solution,
    VerificationRecord,
)
from copose.self_motion.misses.nearest_miss import misses

_STANDS = 1e-6
# Of what is known when a search has to end, so many are measured.
_ASKED = 4


@dataclass(frozen=True, eq=False)
class PlacedRun:
    """One answer in the making.

    Attributes:
        run: of the cell as the file has it.
    """

    run: Run

    def search(self, effort: EffortName, verify: bool) -> Solution:
        """Search everything; the best so far where the call has to end."""
        run = self.run
        search = PlacementSearch(run.model, run.cell, run.seed, effort)
        try:
            return self._searched(search, effort, verify)
        except StoppedError as stop:
            with sheltered():
                found = search.so_far
                before, notes = self._before(search, found)
                some = replace(found, optima=found.optima[:_ASKED])
                after = self._best(search, some, before)
                if after is None:
                    raise
                notes += (best_so_far(stop),)
                return self._answer(search, found, effort, before, after, notes, None)

    def _searched(self, search: PlacementSearch, effort: EffortName, verify: bool) -> Solution:
        run = self.run
        found = search.run()
        before, notes = self._before(search, found)
        after = self._best(search, found, before)
        verification = None
        if verify and after is not None:
            stage("verifying")
            seed = int(np.random.SeedSequence([run.seed, 1]).generate_state(1)[0])
            again = PlacementSearch(run.model, run.cell, seed, "high")
            second = again.run()
            other = self._best(again, second, before)
            stands = other is None or other.value <= after.value + _STANDS
            verification = VerificationRecord(
                seed=seed, objective=None if other is None else other.value, stands=stands
            )
            if not stands and other is not None:
                after, found = other, second
                notes += ("the first search missed this posture; the second found it",)
        if after is not None:
            for k, case in enumerate(after.cases):
                one = replace(run, setting=search.setting(k, after.placed.x[k]))
                notes += one.overlap(case.measured)
        return self._answer(search, found, effort, before, after, notes, verification)

    def follow(self, start: Placed) -> Solution | None:
        """The local optimum that postures of all cases lead to; None where they do not close."""
        run = self.run
        search = PlacementSearch(run.model, run.cell, run.seed, "low")
        before = self._measured(search, start)
        if before is None:
            return None
        end = search.polish(before.placed)
        found = Placements((end,), (), (), 0, 0, 1, None, ())
        after = self._best(search, found, before)
        if after is None:
            return None
        return self._answer(search, found, "local", before, after, (), None)

    def _measured(self, search: PlacementSearch, placed: Placed) -> Placing | None:
        """A placement as it is reported; None where a chain is open or a number is missing."""
        cases, joints = [], []
        for k, (x, q) in enumerate(zip(placed.x, placed.q, strict=True)):
            one = replace(self.run, setting=search.setting(k, x))
            closed = [one.closed(i, mine) for i, mine in enumerate(one.cell.system.split(q))]
            mine = [part for part in closed if part is not None]
            if len(mine) < len(closed):
                return None
            measured = one.model.measure(one.setting, mine)
            error = max(measured.posture.closure_error.values())
            if measured.value is None or error > CLOSURE_TOLERANCE:
                return None
            cases.append(Case(measured, search.weights[k]))
            joints.append(np.concatenate(mine))
        return Placing(replace(placed, q=tuple(joints)), tuple(cases))

    def _best(
        self, search: PlacementSearch, found: Placements, before: Placing | None
    ) -> Placing | None:
        """The best optimum that passes its own check, or the start where none is better."""
        best = None
        for optimum in found.optima:
            placing = self._measured(search, optimum)
            if placing is None:
                continue
            off = abs(placing.value - optimum.value)
            if off <= 1e-6 * max(1.0, abs(optimum.value)) and all(
                self.run.kept(case.measured) for case in placing.cases
            ):
                best = placing
                break
        if (
            before is not None
            and (best is None or before.value > best.value)
            and all(self.run.allowed(case.measured) for case in before.cases)
        ):
            return before
        return best

    def _before(
        self, search: PlacementSearch, found: Placements
    ) -> tuple[Placing | None, tuple[str, ...]]:
        """At the file's pose, clipped into the ranges, the start or the seed's first posture."""
        xs, problem = search.nominal, self.run.cell.problem
        if len(found.first) < len(xs):
            return None, ()
        cases, joints = [], []
        notes: list[str] = []
        for k, each in enumerate(found.first):
            if any(len(sample.closed) == 0 for sample in each.samples):
                return None, ("at the file's pose no posture closes the chain",)
            one = replace(self.run, setting=search.setting(k, xs[k]))
            measured, more = one.before(each)
            case = f"{problem.cases[k].name}: " if problem.cases else ""
            notes += [case + note for note in more]
            cases.append(Case(measured, search.weights[k]))
            joints.append(np.concatenate([np.array(q) for q in measured.posture.joints.values()]))
        placed = Placed(xs, tuple(joints), 0.0)
        return Placing(placed, tuple(cases)), tuple(dict.fromkeys(notes))

    def _answer(
        self,
        search: PlacementSearch,
        found: Placements,
        effort: str,
        before: Placing | None,
        after: Placing | None,
        notes: tuple[str, ...],
        verification: VerificationRecord | None,
    ) -> Solution:
        run = self.run
        value = None if after is None else after.value
        status: Status = "solved"
        reason, miss = None, None
        if after is None:
            status, reason, miss = self._why(search, found)
        return answer(
            run.cell,
            run.model.objective,
            status=status,
            reason=reason,
            notes=notes,
            before=before,
            after=after,
            miss=miss,
            search=_record(run.cell, found, run.seed, effort, value, verification),
            timing=run.timing,
            links=run.model.links,
        )

    def _why(
        self, search: PlacementSearch, found: Placements
    ) -> tuple[Status, str, Measurement | None]:
        """Status, reason and the nearest miss of a search that found nothing."""
        run = self.run
        wherever, alone = "", found.tried == 1
        if not alone:
            wherever = f"; none of {found.tried} placements within the free ranges does better"
        names = search.case_names
        for k, each in enumerate(found.first):
            if any(len(sample.closed) == 0 for sample in each.samples):
                setting = search.setting(k, search.nominal[k])
                joints, reason, sure = misses(
                    setting.cell, run.model.arms, setting.placement.goals, each.samples
                )
                measured = run.model.measure(setting, joints)
                in_case = f"in case {names[k]!r} " if names[k] else ""
                freedom = Freedom.of(run.cell.problem)
                sure &= alone or freedom.never_closes(setting.cell, setting.placement.goals)
                return _status(sure), in_case + reason + wherever, measured
        for k, each in enumerate(found.first):
            if each.blocked:
                one = replace(run, setting=search.setting(k, search.nominal[k]))
                in_case = f"in case {names[k]!r} " if names[k] else ""
                reason, sure = one.blocked(each)
                return _status(sure and alone), in_case + reason + wherever, None
        if found.closed == 0:
            one = replace(run, setting=search.setting(0, search.nominal[0]))
            _, beyond = one.within_limits(found.first[0])
            if beyond is not None:
                reason, sure = beyond
                return _status(sure and alone), reason + wherever, None
        ways = [end.status for end in found.failures]
        return "failed", "no local solve converged: " + ", ".join(sorted({*ways})), None


def _status(sure: bool) -> Status:
    return "infeasible" if sure else "failed"


def _record(
    cell: Cell,
    found: Placements,
    seed: int,
    effort: str,
    value: float | None,
    verification: VerificationRecord | None,
) -> SearchRecord:
    ways = [end.status for end in found.failures]
    gap = None if value is None or found.best_sample is None else value - found.best_sample
    samples = {}
    for i, arm in enumerate(cell.arms):
        mine = [each.samples[i] for each in found.searches if len(each.samples) > i]
        branches = [sample.branches for sample in mine if sample.branches is not None]
        samples[arm.name] = SampleRecord(
            tried=sum(sample.tried for sample in mine),
            closed=sum(len(sample.closed) for sample in mine),
            branches=sum(branches) if len(branches) == len(mine) and mine else None,
        )
    return SearchRecord(
        seed=seed,
        effort=effort,
        samples=samples,
        combinations=sum(each.combinations for each in found.searches),
        best_sample=found.best_sample,
        gap=gap,
        starts=sum(each.starts for each in found.searches) + found.polished,
        local_optima=tuple(Optimum(objective=o.value, count=o.count) for o in found.optima),
        failures=tuple(FailureRecord(status=way, count=ways.count(way)) for way in sorted({*ways})),
        verification=verification,
        placements=PlacementRecord(tried=found.tried, closed=found.closed, polished=found.polished),
    )
