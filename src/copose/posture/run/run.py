"""One answer in the making: from what a search found to a result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from copose.cell.cell import Cell
from copose.cell.notes import best_so_far, margin_notes
from copose.measurement.meter import Measurement
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.reachable.reachability import Reached, reachable
from copose.posture.reachable.search import ReachableSet
from copose.posture.search.global_search import (
    EFFORTS,
    Found,
    climbed,
    local_search,
    search,
)
from copose.posture.search.heaviest import all_judged, combinations, heaviest, uncarried
from copose.posture.setting import Setting
from copose.posture.solution import Status, answer
from copose.progress import StoppedError, heed, sheltered, stage
from copose.results import (
    FailureRecord,
    Optimum,
    SampleRecord,
    SearchRecord,
    Solution,
    Timing,
    VerificationRecord,
    vector,
)
from copose.self_motion.misses.nearest_miss import misses
from copose.self_motion.projection import CLOSED, project

EffortName: TypeAlias = Literal["low", "normal", "high"]

# What a returned posture may miss its grasp by, m or rad.
CLOSURE_TOLERANCE = 1e-8
# What a start may miss its grasp by without a note, m or rad: as `evaluate` takes it for closed.
_START_CLOSED = 1e-6
_STANDS = 1e-6
# By what the start may be worse than the best and be the answer, relative.
_TIE = 1e-9
_NUDGES = 8
# Of what is known when a search has to end, so many are measured.
_ASKED = 4


@dataclass
class _SoFar:
    """What an answer in the making has come to."""

    within: ReachableSet | None = None
    found: Found = field(default_factory=lambda: Found(()))


@dataclass(frozen=True, eq=False)
class Run:
    """One answer in the making."""

    model: PostureModel
    setting: Setting
    seed: int
    build_s: float
    began: float

    @property
    def cell(self) -> Cell:
        """Where the object is."""
        return self.setting.cell

    @property
    def timing(self) -> Timing:
        """Seconds spent so far."""
        return Timing(
            build_s=self.build_s,
            search_s=time.perf_counter() - self.began,
            kernels="compiled" if self.model.compiled_already else "virtual machine",
        )

    def search(self, effort: EffortName, verify: bool) -> Solution:
        """Search everything; the best so far where the call has to end."""
        so_far = _SoFar()
        try:
            return self._searched(effort, verify, so_far)
        except StoppedError as stop:
            with sheltered():
                return self._cut_short(effort, so_far, stop)

    def _cut_short(self, effort: EffortName, so_far: _SoFar, stop: StoppedError) -> Solution:
        """The best so far of a call that has to end.

        Raises:
            StoppedError: there is nothing yet.
        """
        within, found = so_far.within, so_far.found
        samples = found.samples if within is None else within.samples
        if len(samples) < len(self.cell.arms) or not all(len(s.closed) for s in samples):
            raise stop
        before, notes = self.before(found) if within is None else self._where(within)
        some = replace(found, optima=found.optima[:_ASKED])
        after, _ = self._best(some, before, within)
        if after is None and before.value is not None and self.allowed(before):
            after = before
        if after is None:
            raise stop
        return answer(
            self.cell,
            self.model.objective,
            status="solved",
            notes=(*notes, best_so_far(stop)),
            before=before,
            after=after,
            search=self._record(found, self.seed, effort, after.value),
            timing=self.timing,
            links=self.model.links,
        )

    def _searched(self, effort: EffortName, verify: bool, so_far: _SoFar) -> Solution:
        status: Status
        within, found = self._found(effort, so_far)
        so_far.found = found
        heed()
        if any(len(sample.closed) == 0 for sample in found.samples):
            if within is not None:
                reason, sure = within.stuck
                return self._none(found, effort, reason, *self._where(within), sure=sure)
            joints, reason, sure = misses(
                self.setting.cell,
                self.model.arms,
                self.setting.placement.goals,
                found.samples,
            )
            miss = self.model.measure(self.setting, joints)
            return self._none(found, effort, reason, miss=miss, sure=sure)
        before, notes = self.before(found) if within is None else self._where(within)
        if within is not None and within.too_near is not None:
            near = within.too_near
            reason = f"the arms cannot move from a start that is too near: {near.reason}"
            return self._none(found, effort, reason, before, notes, sure=near.sure)
        if found.blocked:
            reason, sure = self.blocked(found)
            return self._none(found, effort, reason, before, notes, sure=sure)
        if within is None:
            found, beyond = self.within_limits(found)
            if beyond is not None:
                reason, sure = beyond
                return self._none(found, effort, reason, before, notes, sure=sure)
        so_far.found = found
        after, value = self._best(found, before, within)
        verification = None
        if verify and value is not None:
            verification, better = self._verified(effort, value, within)
            if better is not None:
                found = so_far.found = better
                after, value = self._best(found, before, within)
        reached = self._reached(found, before, after, within)
        if reached.why and any(arm.start is not None for arm in self.cell.arms):
            notes += (
                "the best posture cannot be reached from the start without letting go "
                f"({'; '.join(reached.why)}); [search] reachable = true keeps to what can",
            )
        status = "solved" if after is not None else "failed"
        if after is None and within is not None and within.single:
            status = "infeasible"
        return answer(
            self.cell,
            self.model.objective,
            status=status,
            reason=self._why(found, before, within) if after is None else None,
            notes=(*notes, *self.overlap(after), *_verdict(verification)),
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
            links=self.model.links,
            reachable=reached.whole,
        )

    def _found(self, effort: EffortName, so_far: _SoFar) -> tuple[ReachableSet | None, Found]:
        """What is searched where only what can be reached counts, and what a search finds."""
        tried = EFFORTS[effort]
        if not self.cell.problem.search.reachable:
            return None, search(self.model, self.setting, self.seed, tried)
        starts = [self.start(i)[0] for i in range(len(self.cell.arms))]
        within = ReachableSet.of(self.model, self.setting, starts, self.seed, tried)
        if not isinstance(within, ReachableSet):
            return None, Found(within)
        so_far.within = within
        return within, within.search(self.seed, tried)

    def _none(
        self,
        found: Found,
        effort: str,
        reason: str,
        before: Measurement | None = None,
        notes: tuple[str, ...] = (),
        *,
        miss: Measurement | None = None,
        sure: bool,
    ) -> Solution:
        """The answer where no posture does, for a reason that holds, or none that was found."""
        return answer(
            self.cell,
            self.model.objective,
            status="infeasible" if sure else "failed",
            reason=reason,
            notes=notes,
            before=before,
            miss=miss,
            search=self._record(found, self.seed, effort, None),
            timing=self.timing,
            links=self.model.links,
        )

    def _reached(
        self,
        found: Found,
        before: Measurement,
        after: Measurement | None,
        within: ReachableSet | None,
    ) -> Reached:
        """Whether the best posture can be reached from the one before."""
        if after is None:
            return Reached(None)
        if after is before or within is not None:
            return Reached(True)
        start, end = ([np.array(q) for q in each.posture.joints.values()]
                      for each in (before, after))  # fmt: skip
        samples = [sample.closed for sample in found.samples]
        return reachable(self.model, self.setting, start, end, samples)

    def follow(self, joints: Sequence[Array]) -> Solution | None:
        """The local optimum that a posture leads to; None where it cannot be closed."""
        closed = [self.closed(i, q) for i, q in enumerate(joints)]
        q = [mine for mine in closed if mine is not None]
        if len(q) < len(closed):
            return None
        before = self.model.measure(self.setting, q)
        within = None
        if self.cell.problem.search.reachable:
            around = ReachableSet.of(self.model, self.setting, q, self.seed, EFFORTS["low"])
            if not isinstance(around, ReachableSet) or around.too_near is not None:
                return None
            within = around
        setting = self.setting if within is None else within.setting
        found = local_search(self.model, setting, np.concatenate(q))
        if within is not None:
            found = within.confirmed(found)
        after, value = self._best(found, before, within)
        if after is None:
            return None
        return answer(
            self.cell,
            self.model.objective,
            status="solved",
            before=before,
            after=after,
            search=self._record(found, self.seed, "local", value),
            timing=self.timing,
            links=self.model.links,
            reachable=None if within is None else True,
        )

    def closed(self, i: int, q: Array, *, as_given: bool = False) -> Array | None:
        """Joints of arm i as they are where they hold the object, else projected, or None.

        Args:
            i: the arm.
            q: joint positions, (n,).
            as_given: even where they are nearer to a limit than the margin allows.
        """
        kernels, cell, goal = self.model.arms[i], self.cell, self.setting.placement.goals[i]
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

    def before(self, found: Found) -> tuple[Measurement, tuple[str, ...]]:
        """The start of the file, closed, or the first closed posture that the seed gives."""
        joints: list[Array] = []
        notes: list[str] = []
        for i, sample in enumerate(found.samples):
            q, said = self.start(i)
            notes += said
            joints.append(sample.closed[0] if q is None else q)
        measured = self.model.measure(self.setting, joints)
        return measured, (*notes, *margin_notes(self.cell, joints))

    def start(self, i: int) -> tuple[Array | None, tuple[str, ...]]:
        """Joints of arm i where its start closes, None where it has none or it does not close; and
        a note where they are not the file's.
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
        if max(distance, angle if rigid else 0.0) <= _START_CLOSED:
            return q, ()
        moved = np.abs(cell.nearest_turn(i, q - arm.start))
        joint = arm.joints[int(moved.argmax())]
        unit = "rad" if joint.kind == "revolute" else "m"
        return q, (
            f"{missed}: it was projected onto it (check start and grasp), which moved the joints "
            f"by up to {moved.max():.3g} {unit} ({joint.name})",
        )

    def _where(self, within: ReachableSet) -> tuple[Measurement, tuple[str, ...]]:
        """Where the arms are that have to reach what is sought."""
        notes: list[str] = []
        for i, arm in enumerate(self.cell.arms):
            notes += self.start(i)[1]
            if arm.start is None:
                notes.append(
                    f"arm {arm.name!r} has no start: it is taken to be where the seed's first "
                    "posture is; give it one"
                )
        measured = self.model.measure(self.setting, within.start)
        return measured, (*notes, *margin_notes(self.cell, within.start))

    def _best(
        self, found: Found, before: Measurement | None, within: ReachableSet | None = None
    ) -> tuple[Measurement | None, float | None]:
        """The best optimum that passes its own check, or the start where none is better."""
        cell, best = self.cell, None
        for optimum in found.optima:
            joints = [
                self.closed(i, q, as_given=within is not None)
                for i, q in enumerate(cell.system.split(optimum.q))
            ]
            if any(q is None for q in joints):
                continue
            measured = self.model.measure(self.setting, [q for q in joints if q is not None])
            if (
                measured.value is not None
                and max(measured.posture.closure_error.values()) <= CLOSURE_TOLERANCE
                and abs(measured.value - optimum.objective) <= 1e-6 * max(1.0, abs(measured.value))
                and self.kept(measured)
            ):
                best = measured
                break
        if best is not None and best.value is not None and before is not None:
            start = before.value if self.allowed(before) else None
            # A tie moves no robot that is told where it stands.
            given = all(arm.start is not None for arm in cell.arms)
            tie = _TIE * max(1.0, abs(best.value)) if given else 0.0
            if start is not None and start > best.value - tie:
                best = before
        if best is None and within is not None and before is not None and self.allowed(before):
            best = before
        return best, None if best is None else best.value

    def within_limits(self, found: Found) -> tuple[Found, tuple[str, bool] | None]:
        """A search, or why torque limits allow no posture of all that were compared, and whether
        that is sure.

        Where few postures hold the object a sample may have none: those that hold the most tell.
        """
        model = self.model
        if found.starts > 0 or model.capacity is None:
            return found, None
        if model.static:
            most = heaviest(self.cell, self.seed)
            q, sure = most.q, most.sure
            few = combinations([sample.closed for sample in found.samples])
            if len(few) and all(self.cell.spare(i) <= 0 for i in range(len(self.cell.arms))):
                q, sure = few, True
            held = model.held(self.setting, q) if len(q) else np.zeros(0, dtype=bool)
            if not held.any():
                return found, (most.reason, sure)
            return climbed(model, self.setting, found, q[held]), None
        kind = model.objective.kind
        reason = (
            f"the torque limits allow no {kind} as it is asked for in any posture found: they "
            "leave no such motion of the object, all its other accelerations zero"
        )
        return found, (reason, all_judged(self.cell) or uncarried(self.setting))

    def kept(self, measured: Measurement) -> bool:
        """Whether a posture keeps the constraints, as far as they are measured."""
        constraints = self.model.feasibility.constraints
        return all(constraint.kept(measured.posture) for constraint in constraints)

    def overlap(self, measured: Measurement | None) -> tuple[str, ...]:
        """A note where bodies of an answer overlap that nothing keeps apart, or on their shapes."""
        if self.model.bodies is not None:
            return self.model.scene.notes
        if measured is None:
            return ()
        joints = [np.array(q) for q in measured.posture.joints.values()]
        return self.model.overlap(self.cell, joints)

    def blocked(self, found: Found) -> tuple[str, bool]:
        """What is too near in every posture, and by how much at best; and whether that is sure."""
        reasons = "; ".join(each.reason for each in found.blocked)
        return f"no posture keeps the clearance: {reasons}", any(b.sure for b in found.blocked)

    def allowed(self, measured: Measurement) -> bool:
        """Whether a posture keeps limits and margins, and holds the object where it must."""
        joints = measured.posture.joints
        return self.kept(measured) and all(
            np.all((np.array(joints[arm.name]) >= low) & (np.array(joints[arm.name]) <= high))
            for arm, low, high in zip(self.cell.arms, self.cell.lower, self.cell.upper, strict=True)
        )

    def _verified(
        self, effort: EffortName, value: float, within: ReachableSet | None
    ) -> tuple[VerificationRecord, Found | None]:
        """A second search, and what it found where that is better."""
        stage("verifying")
        seed = int(np.random.SeedSequence([self.seed, 1]).generate_state(1)[0])
        more = EFFORTS[effort].doubled()
        again = (
            search(self.model, self.setting, seed, more)
            if within is None
            else within.search(seed, more)
        )
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
        gap = None
        if value is not None and found.best_sample is not None:
            gap = value - found.best_sample
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
            gap=gap,
            starts=found.starts,
            local_optima=tuple(self._optimum(each) for each in found.optima),
            failures=tuple(
                FailureRecord(status=way, count=ways.count(way)) for way in sorted({*ways})
            ),
            verification=verification,
        )

    def _optimum(self, found: LocalOptimum) -> Optimum:
        parts = enumerate(zip(self.cell.arms, self.cell.system.split(found.q), strict=True))
        joints = {arm.name: vector(self.cell.folded(i, q)) for i, (arm, q) in parts}
        return Optimum(objective=found.objective, count=found.count, joints=joints)

    def _why(self, found: Found, before: Measurement, within: ReachableSet | None) -> str:
        if within is not None:
            return "nothing that can be reached from the start, nor that itself, is allowed"
        if before.value is None and before.notes:
            return before.notes[0]
        if not found.failures:
            return "no local optimum passed its own check of closure and objective"
        units = {constraint.name: constraint.unit for constraint in self.model.program.constraints}
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
