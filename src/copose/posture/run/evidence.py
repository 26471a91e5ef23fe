"""Evidence for an answer: the record of its search, its verification, and reasons of a failure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.cell.cell import Cell
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum, LocalSolve
from copose.posture.search.global_search import climbed
from copose.posture.search.heaviest import all_combinations, all_judged, heaviest_object, uncarried
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.results import (
    BasinRecord,
    FailureRecord,
    Optimum,
    ProofRecord,
    SampleRecord,
    SearchRecord,
    VerificationRecord,
    vector,
)


def search_record(
    cell: Cell,
    outcome: SearchOutcome,
    seed: int,
    effort: str,
    value: float | None,
    verification: VerificationRecord | None = None,
    proof: ProofRecord | None = None,
) -> SearchRecord:
    """The record of a search for postures.

    Args:
        cell: the arms.
        outcome: of the search.
        seed: of everything that was drawn.
        effort: how much was tried, by name.
        value: the objective of the answer; None where there is none.
        verification: of the answer, where it was asked for.
        proof: alike.
    """
    gap = None
    if value is not None and outcome.best_sample is not None:
        gap = value - outcome.best_sample
    optima = _optima(cell, outcome.optima)
    return SearchRecord(
        seed=seed,
        effort=effort,
        samples={
            arm.name: SampleRecord(
                tried=sample.tried, closed=len(sample.closed), branches=sample.branches
            )
            for arm, sample in zip(cell.arms, outcome.samples, strict=False)
        },
        combinations=outcome.combinations,
        best_sample=outcome.best_sample,
        bound=outcome.bound,
        gap=gap,
        starts=outcome.starts,
        local_optima=optima,
        basins=BasinRecord.of(optima, value, outcome.met),
        failures=failure_records(outcome.failures),
        verification=verification,
        proof=proof,
    )


def _optima(cell: Cell, optima: Sequence[LocalOptimum]) -> tuple[Optimum, ...]:
    """The records of local optima."""
    if not optima:
        return ()
    parts = cell.system.split(cell.all_folded(np.array([optimum.q for optimum in optima])))
    names = [arm.name for arm in cell.arms]
    return tuple(
        Optimum(
            objective=optimum.objective,
            count=optimum.count,
            joints=dict(zip(names, map(vector, joints), strict=True)),
        )
        for optimum, joints in zip(optima, zip(*parts, strict=True), strict=True)
    )


def failure_records(failures: Sequence[LocalSolve]) -> tuple[FailureRecord, ...]:
    """The ways in which programs failed, and how often each."""
    ways = [end.status for end in failures]
    return tuple(FailureRecord(status=way, count=ways.count(way)) for way in sorted({*ways}))


def verification_seed(seed: int) -> int:
    """The seed of a second search beside that of the first."""
    return int(np.random.SeedSequence([seed, 1]).generate_state(1)[0])


def verification_record(
    seed: int, objective: float | None, value: float, tolerance: float = 1e-6
) -> VerificationRecord:
    """The record of a second search: the answer stands unless its best is better.

    Args:
        seed: of the second search.
        objective: its best; None where it found nothing.
        value: the answer's.
        tolerance: by which a best may be larger and the answer stand.
    """
    stands = objective is None or objective <= value + tolerance
    return VerificationRecord(seed=seed, objective=objective, stands=stands)


def blocked_reason(outcome: SearchOutcome) -> tuple[str, bool]:
    """Bodies that come too near in every posture, and by how much; and whether that is sure."""
    reasons = "; ".join(each.reason for each in outcome.blocked)
    return f"no posture keeps the clearance: {reasons}", any(b.sure for b in outcome.blocked)


def unsolved_reason(model: PostureModel, outcome: SearchOutcome, tolerance: float) -> str:
    """Reason of a search of which no local optimum is an answer.

    Args:
        model: what is built.
        outcome: of the search.
        tolerance: beyond which a constraint counts as violated.
    """
    if not outcome.failures:
        return "no local optimum passed its own check of closure and objective"
    units = {constraint.name: constraint.unit for constraint in model.program.constraints}
    worst = [
        f"{name} {violation:.1e} {units[name]}"
        for name, violation in outcome.failures[0].violations.items()
        if violation > tolerance
    ]
    return f"no local solve converged: {outcome.failures[0].status} {', '.join(worst)}".strip()


def within_limits(
    model: PostureModel, setting: Setting, outcome: SearchOutcome, seed: int
) -> tuple[SearchOutcome, tuple[str, bool] | None]:
    """A search that has something within torque limits, or the reason why nothing is; that is
    another constraint where one alone allows nothing.

    Where few postures hold the object a sample may have none: climbs start from those that hold the
    most then.

    Returns:
        The outcome; and where no posture of all that were compared is allowed, a sentence and
        whether that is sure.
    """
    cell = setting.cell
    if outcome.starts > 0:
        return outcome, None
    excluded = _excluded(model, setting, outcome, seed)
    if excluded is not None or model.capacity is None:
        return outcome, excluded
    if any(constraint.torque_limited for constraint in model.feasibility.constraints):
        most = heaviest_object(cell, seed)
        q, sure = most.q, most.sure
        few = all_combinations([sample.closed for sample in outcome.samples])
        if len(few) and all(cell.spare(i) <= 0 for i in range(len(cell.arms))):
            q, sure = few, True
        held = model.feasibility.held(setting, q) if len(q) else np.zeros(0, dtype=bool)
        if not held.any():
            return outcome, (most.reason, sure)
        return climbed(model, setting, outcome, q[held]), None
    kind = model.objective.kind
    reason = (
        f"the torque limits allow no {kind} as it is asked for in any posture found: they "
        "leave no such motion of the object, all its other accelerations zero"
    )
    return outcome, (reason, all_judged(cell) or uncarried(setting))


def _excluded(
    model: PostureModel, setting: Setting, outcome: SearchOutcome, seed: int, most: int = 1024
) -> tuple[str, bool] | None:
    """The reason where one constraint, beside the clearance and torque limits, which have reasons
    of their own, allows none of the arms' combinations, or none of a random choice of so many; and
    whether that is sure.
    """
    constraints = [c for c in model.feasibility.constraints if c.judged and not c.torque_limited]
    if not constraints:
        return None
    cell, postures = setting.cell, [sample.closed for sample in outcome.samples]
    q = all_combinations(postures)
    sure = len(q) > 0 and all(cell.spare(i) <= 0 for i in range(len(cell.arms)))
    if not len(q):
        rng = np.random.default_rng([seed, len(postures), 4])
        q = np.hstack([each[rng.integers(0, len(each), most)] for each in postures])
    for constraint in constraints:
        if not constraint.allows(setting, model.split(q)).any():
            return f"no posture that was compared keeps the constraint {constraint.name!r}", sure
    return None
