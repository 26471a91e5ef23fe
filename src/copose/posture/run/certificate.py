"""The certificate of an answer: the record of a proof that nothing beats it by more than ε."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.search.global_search import climbed
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.progress import StoppedError, attained, hushed
from copose.proof.proof import Proof
from copose.results import ProofRecord

ASSUMPTIONS = (
    "every self-motion passes a slice; roots of a slice are found in floating point, and counted",
    "pieces of self-motions over 0.03 rad beyond joint limits are followed, not enclosed",
    "the numbers of the files are exact, but for rounding",
)


def certified(
    model: PostureModel, setting: Setting, outcome: SearchOutcome, value: float, epsilon: float
) -> tuple[ProofRecord, SearchOutcome | None]:
    """The proof that nothing beats an answer by more than ε; and the outcome with what does.

    Args:
        model: what is built.
        setting: where the object is.
        outcome: of the search.
        value: of its answer.
        epsilon: ε, in the objective's unit.
    """
    began, proof, found = time.perf_counter(), Proof(value, epsilon), list[LocalOptimum]()
    constrained = bool(model.feasibility.constraints) or setting.cell.problem.search.reachable

    def better(q: Sequence[Array]) -> float | None:
        """What the best of some postures is polished to, where it beats the best; where constraints
        forbid postures, which the proof leaves out, its own value.
        """
        inside = np.all([setting.cell.beyond(i, part) <= 0 for i, part in enumerate(q)], axis=0)
        values = np.where(inside, setting.objective.values(setting, q), -np.inf)
        k = int(np.nan_to_num(values, nan=-np.inf).argmax())
        if not values[k] > proof.value + 1e-9 * max(1.0, abs(proof.value)):
            return None
        proof.value, posture = float(values[k]), np.hstack(q)[k]
        if not constrained:
            with hushed():
                found.extend(climbed(model, setting, SearchOutcome(), posture[None]).optima)
            found.append(LocalOptimum(posture, proof.value, 1))
            proof.value = max(optimum.objective for optimum in found)
            attained(proof.value)
        return proof.value

    try:
        proof.run(setting.cell, model.arms, setting.placement, setting.objective, better)
    except StoppedError as stop:
        proof.reason = str(stop)
    answer = value if constrained else max(value, proof.value)
    kinds = "colliding or not, " if setting.bodies is not None else "allowed or not, "
    record = _record(proof, setting, answer, kinds if constrained else "")
    record = record.model_copy(update={"seconds": time.perf_counter() - began})
    optima = tuple(sorted((*found, *outcome.optima), key=lambda optimum: -optimum.objective))
    return record, replace(outcome, optima=optima) if found else None


def unproved(epsilon: float, reason: str | None) -> ProofRecord:
    """The record where nothing is proved."""
    return ProofRecord(
        epsilon=epsilon, bound=None, gap=None, statement=f"nothing is proved: {reason}",
        assumptions=(), self_motions={}, slices={}, odd=0, segments={}, combinations=0, seconds=0.0,
    )  # fmt: skip


def _record(proof: Proof, setting: Setting, value: float, kinds: str) -> ProofRecord:
    """The record of a proof about postures of some kinds, of an answer's value."""
    names, search = [arm.name for arm in setting.cell.arms], proof.search
    record = unproved(proof.epsilon, proof.reason)
    if search is None or not np.isfinite(search.highest):
        return record
    bound, slices = max(search.highest, value), proof.slices
    odd = sum(each.odd for each in slices)
    sliced = [
        f"{each.slices} slices of {len(each.joints)} joints" for each in slices if each.joints
    ]
    things, verb = ("self-motions", "meet") if sliced else ("postures", "gives")
    met = " and ".join(dict.fromkeys(sliced)) or "elimination"
    beyond = proof.epsilon if proof.done and not kinds else bound - value
    statement = (
        f"no posture{',' * bool(kinds)} {kinds}on the "
        f"{' × '.join(str(each.count) for each in proof.motions)} {things} beats this by more than "
        f"{_rounded_up(beyond)}; {things}: all that {met} {verb}, "
        + (f"{odd} counts odd: some may be missing" if odd else "no count odd")
        + ("" if proof.done else f" ({_rounded_up(proof.epsilon)} was asked for: {proof.reason})")
    )
    counts = {
        "self_motions": [each.count for each in proof.motions],
        "slices": [each.slices for each in slices],
        "segments": [len(each.ends) for each in proof.segments],
    }
    by_arm = {key: dict(zip(names, each, strict=True)) for key, each in counts.items()}
    return record.model_copy(update=by_arm | {
        "bound": bound, "gap": bound - value, "statement": statement, "assumptions": ASSUMPTIONS,
        "odd": odd, "combinations": search.combinations,
    })  # fmt: skip


def _rounded_up(value: float) -> str:
    """A number to two digits, ``1e-6``."""
    unit = 10.0 ** np.floor(np.log10(max(value, 1e-300)) - 1)
    return f"{np.ceil(value / unit - 1e-6) * unit:.2g}".replace("e-0", "e-")
