"""One call of a planner where nothing but joints is free: from a search to a solution."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from copose.cell.cell import Cell
from copose.cell.notes import best_so_far, margin_notes
from copose.measurement.meter import Measurement
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.reachable.reachability import Reached, reachable
from copose.posture.run.acceptance import Acceptance
from copose.posture.run.evidence import (
    blocked_reason,
    search_record,
    unsolved_reason,
    verification_record,
    verification_seed,
    within_limits,
)
from copose.posture.search.effort import EFFORTS, Effort
from copose.posture.search.global_search import climbed, search
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.posture.solution import MeasuredCases, Status, solution_of
from copose.progress import StoppedError, heed, sheltered, stage
from copose.results import Solution, Timing, VerificationRecord

if TYPE_CHECKING:
    from copose.posture.reachable.search import ReachableSet


@dataclass
class _SoFar:
    """State of a search: the reachable postures, where only they count, and an outcome."""

    within: ReachableSet | None = None
    outcome: SearchOutcome = field(default_factory=SearchOutcome)


@dataclass(frozen=True, eq=False)
class Run:
    """One call of a planner.

    Attributes:
        model: what is built.
        setting: where the object is.
        seed: of everything that is drawn.
        build_s: seconds that building took.
        began: when the call did, on the clock of `time.perf_counter`.
        tie: relative, by which a start that the file gives may be worse than the best and be the
            answer: no robot moves for less.
    """

    model: PostureModel
    setting: Setting
    seed: int
    build_s: float
    began: float
    tie: float = 1e-9

    @property
    def cell(self) -> Cell:
        """The cell with its object where it is."""
        return self.setting.cell

    @property
    def acceptance(self) -> Acceptance:
        """The checks of an answer."""
        return Acceptance(self.model, self.setting)

    @property
    def timing(self) -> Timing:
        """Seconds spent so far."""
        return Timing(
            build_s=self.build_s,
            search_s=time.perf_counter() - self.began,
            kernels="compiled" if self.model.compiled_already else "virtual machine",
        )

    @property
    def solution(self) -> partial[Solution]:
        """The result of this call: `solution_of` but for what the call itself knows."""
        model = self.model
        return partial(
            solution_of, self.cell, model.objective, timing=self.timing, links=model.links
        )

    def search(self, effort: Effort, verify: bool, epsilon: float | None = None) -> Solution:
        """The best of everything; the best so far where the call has to end.

        With ε it is proved, as far as that goes, that nothing beats it by more.
        """
        so_far = _SoFar()
        try:
            return self._searched(effort, verify, epsilon, so_far)
        except StoppedError as stop:
            with sheltered():
                return self._cut_short(effort, epsilon, so_far, stop)

    def _cut_short(
        self, effort: Effort, epsilon: float | None, so_far: _SoFar, stop: StoppedError
    ) -> Solution:
        """The best so far of a call that has to end before a proof begins.

        Raises:
            StoppedError: there is nothing yet.
        """
        within, outcome = so_far.within, so_far.outcome
        samples = outcome.samples if within is None else within.samples
        if len(samples) < len(self.cell.arms) or not all(len(s.closed) for s in samples):
            raise stop
        before, notes = self._before(so_far)
        quick = replace(outcome, optima=outcome.optima[: effort.measured])
        after = self._best(quick, before, within)
        if after is None and before.value is not None and self.acceptance.allowed(before):
            after = before
        if after is None:
            raise stop
        proof = None
        if epsilon is not None:
            from copose.posture.run.certificate import unproved

            proof = unproved(epsilon, str(stop))
        return self.solution(
            status="solved",
            search=search_record(
                self.cell, outcome, self.seed, effort.name, after.value, proof=proof
            ),
            notes=(*notes, best_so_far(stop)),
            before=MeasuredCases.single(before),
            after=MeasuredCases.single(after),
        )

    def _searched(
        self, effort: Effort, verify: bool, epsilon: float | None, so_far: _SoFar
    ) -> Solution:
        """The best of everything that a search finds, which is kept in ``so_far`` as it goes."""
        so_far.outcome = self._search(effort, so_far)
        heed()
        if not so_far.outcome.closed:
            return self._open(effort, so_far)
        within = so_far.within
        before, notes = self._before(so_far)
        forbidden = self._forbidden(so_far)
        if forbidden is not None:
            reason, sure = forbidden
            return self._none(so_far.outcome, effort, reason, sure, before=before, notes=notes)
        after = self._best(so_far.outcome, before, within)
        verification: VerificationRecord | None = None
        seed = self.seed
        if verify and after is not None and after.value is not None:
            verification, better = self._verified(effort, after.value, within)
            if better is not None:
                so_far.outcome, seed = better, verification.seed
                after = self._best(better, before, within)
        outcome, proof = so_far.outcome, None
        if epsilon is not None and after is not None and after.value is not None:
            from copose.posture.run.certificate import Certificate

            proof = Certificate.of(self.model, self.setting, outcome, after.value, epsilon)
        with sheltered() if proof is not None else nullcontext():
            if proof is not None and proof.outcome is not None:
                outcome, after = proof.outcome, self._best(proof.outcome, before, within)
            reached = self._reached(outcome, before, after, within)
            if reached.why and any(arm.start is not None for arm in self.cell.arms):
                notes += (
                    "the best posture cannot be reached from the start without letting go "
                    f"({'; '.join(reached.why)}); [search] reachable = true keeps to what can",
                )
            status: Status = "solved" if after is not None else "failed"
            if after is None and within is not None and within.single:
                status = "infeasible"
            value, certificate = None if after is None else after.value, None
            if proof is not None and after is not None and value is not None:
                certificate = proof.record(
                    value, [np.array(q) for q in after.posture.joints.values()]
                )
            return self.solution(
                status=status,
                search=search_record(
                    self.cell, outcome, seed, effort.name, value, verification, certificate
                ),
                reason=self._why(outcome, before, within) if after is None else None,
                notes=(*notes, *self.acceptance.overlap(after), *_verdict(verification)),
                before=MeasuredCases.single(before),
                after=None if after is None else MeasuredCases.single(after),
                reachable=reached.whole,
            )

    def _search(self, effort: Effort, so_far: _SoFar) -> SearchOutcome:
        """Outcome of a search among all postures, or those that can be reached from the start."""
        if not self.cell.problem.search.reachable:
            return search(self.model, self.setting, self.seed, effort)
        from copose.posture.reachable.search import ReachableSet

        starts = [self.acceptance.start(i)[0] for i in range(len(self.cell.arms))]
        within = ReachableSet.of(self.model, self.setting, starts, self.seed, effort)
        if not isinstance(within, ReachableSet):
            return SearchOutcome(within)
        so_far.within = within
        return within.search(self.seed, effort)

    def _open(self, effort: Effort, so_far: _SoFar) -> Solution:
        """The result where an arm has no posture that holds the object."""
        within, outcome = so_far.within, so_far.outcome
        if within is not None:
            reason, sure = within.stuck
            before, notes = self._before(so_far)
            return self._none(outcome, effort, reason, sure, before=before, notes=notes)
        from copose.self_motion.misses.nearest_miss import misses

        joints, reason, sure = misses(
            self.setting.cell, self.model.arms, self.setting.placement.goals, outcome.samples
        )
        miss = self.model.measure(self.setting, joints)
        return self._none(outcome, effort, reason, sure, miss=miss)

    def _forbidden(self, so_far: _SoFar) -> tuple[str, bool] | None:
        """Reason why bodies or torque limits allow no posture, and whether that is sure, or None.

        The outcome so far may gain climbs from postures that torque limits allow.
        """
        within = so_far.within
        if within is not None and within.too_near is not None:
            near = within.too_near
            reason = f"the arms cannot move from a start that is too near: {near.reason}"
            return reason, near.sure
        if so_far.outcome.blocked:
            return blocked_reason(so_far.outcome)
        if within is not None:
            return None
        so_far.outcome, beyond = within_limits(self.model, self.setting, so_far.outcome, self.seed)
        return beyond

    def _none(
        self,
        outcome: SearchOutcome,
        effort: Effort,
        reason: str,
        sure: bool,
        *,
        before: Measurement | None = None,
        notes: tuple[str, ...] = (),
        miss: Measurement | None = None,
    ) -> Solution:
        """The result without a posture, for a reason that surely holds, or as none was found."""
        return self.solution(
            status="infeasible" if sure else "failed",
            search=search_record(self.cell, outcome, self.seed, effort.name, None),
            reason=reason,
            notes=notes,
            before=None if before is None else MeasuredCases.single(before),
            miss=miss,
        )

    def _reached(
        self,
        outcome: SearchOutcome,
        before: Measurement,
        after: Measurement | None,
        within: ReachableSet | None,
    ) -> Reached:
        """Reachability of the best posture from the one before."""
        if after is None:
            return Reached(None)
        if after is before or within is not None:
            return Reached(True)
        start, end = ([np.array(q) for q in measured.posture.joints.values()]
                      for measured in (before, after))  # fmt: skip
        samples = [sample.closed for sample in outcome.samples]
        return reachable(self.model, self.setting, start, end, samples)

    def follow(self, joints: Sequence[Array]) -> Solution | None:
        """The local optimum that a posture leads to; None where it cannot be closed."""
        q = self.acceptance.all_closed(joints)
        if q is None:
            return None
        before = self.model.measure(self.setting, q)
        within = None
        if self.cell.problem.search.reachable:
            from copose.posture.reachable.search import ReachableSet

            around = ReachableSet.of(self.model, self.setting, q, self.seed, EFFORTS["low"])
            if not isinstance(around, ReachableSet) or around.too_near is not None:
                return None
            within = around
        setting = self.setting if within is None else within.setting
        outcome = climbed(self.model, setting, SearchOutcome(), np.concatenate(q)[None])
        if within is not None:
            outcome = within.confirmed(outcome)
        after = self._best(outcome, before, within)
        if after is None:
            return None
        return self.solution(
            status="solved",
            search=search_record(self.cell, outcome, self.seed, "local", after.value),
            before=MeasuredCases.single(before),
            after=MeasuredCases.single(after),
            reachable=None if within is None else True,
        )

    def _before(self, so_far: _SoFar) -> tuple[Measurement, tuple[str, ...]]:
        """The posture before, and notes on it."""
        within = so_far.within
        if within is None:
            return self.acceptance.before(so_far.outcome.samples)
        notes: list[str] = []
        for i, arm in enumerate(self.cell.arms):
            notes += self.acceptance.start(i)[1]
            if arm.start is None:
                notes.append(
                    f"arm {arm.name!r} has no start: it is taken to be where the seed's first "
                    "posture is; give it one"
                )
        measured = self.model.measure(self.setting, within.start)
        return measured, (*notes, *margin_notes(self.cell, within.start))

    def _best(
        self, outcome: SearchOutcome, before: Measurement, within: ReachableSet | None
    ) -> Measurement | None:
        """The best optimum that passes its own check, or the start where none is better."""
        acceptance = self.acceptance
        best = next(self._accepted(outcome, as_given=within is not None), None)
        if best is not None and best.value is not None and acceptance.allowed(before):
            # A tie moves no robot that is told where it stands.
            given = all(arm.start is not None for arm in self.cell.arms)
            tie = self.tie * max(1.0, abs(best.value)) if given else 0.0
            if before.value is not None and before.value > best.value - tie:
                return before
        if best is None and within is not None and acceptance.allowed(before):
            return before
        return best

    def _accepted(self, outcome: SearchOutcome, *, as_given: bool) -> Iterator[Measurement]:
        """Measurements of those optima that pass their own check, best first."""
        acceptance = self.acceptance
        for optimum in outcome.optima:
            q = acceptance.all_closed(self.cell.system.split(optimum.q), as_given=as_given)
            if q is None:
                continue
            measured = self.model.measure(self.setting, q)
            if (
                acceptance.sound(measured)
                and acceptance.confirmed(measured.value, optimum.objective)
                and acceptance.kept(measured)
            ):
                yield measured

    def _verified(
        self, effort: Effort, value: float, within: ReachableSet | None
    ) -> tuple[VerificationRecord, SearchOutcome | None]:
        """The record of a second search, and its outcome where that is better."""
        stage("verifying")
        seed = verification_seed(self.seed)
        again = (
            search(self.model, self.setting, seed, replace(effort.doubled(), complete=True))
            if within is None
            else within.search(seed, effort.doubled())
        )
        objective = again.optima[0].objective if again.optima else None
        record = verification_record(seed, objective, value)
        return record, None if record.stands else again

    def _why(self, outcome: SearchOutcome, before: Measurement, within: ReachableSet | None) -> str:
        """Reason of a search without an answer."""
        if within is not None:
            return "nothing that can be reached from the start, nor that itself, is allowed"
        if before.value is None and before.notes:
            return before.notes[0]
        return unsolved_reason(self.model, outcome, self.acceptance.options.closure)


def _verdict(verification: VerificationRecord | None) -> tuple[str, ...]:
    """A note where a verification found a better posture."""
    if verification is None or verification.stands:
        return ()
    return (
        "the first search missed this posture; the second, with twice the effort and seed "
        f"{verification.seed}, found it",
    )
