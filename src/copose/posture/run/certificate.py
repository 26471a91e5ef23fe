"""The certificate of an answer: the record of a proof that nothing beats it by more than ε."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

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


@dataclass(frozen=True, eq=False)
class Certificate:
    """A proof that nothing beats an answer by more than ε, as far as it went."""

    setting: Setting
    proof: Proof
    seconds: float
    kinds: str  # of postures beside those that count, where constraints are left out
    outcome: (
        SearchOutcome | None
    )  # of the search, with what beats its answer; None where nothing does

    @classmethod
    def of(
        cls, model: PostureModel, setting: Setting, outcome: SearchOutcome, value: float, eps: float
    ) -> Certificate:
        """The certificate of a search and the value of its answer."""
        began, proof, found = time.perf_counter(), Proof(value, eps), list[LocalOptimum]()
        constrained = bool(model.feasibility.constraints) or setting.cell.problem.search.reachable

        def better(q: Sequence[Array]) -> float | None:
            """What the best of some postures is polished to, where it beats the best; where
            constraints forbid postures, which the proof leaves out, its own value.
            """
            inside = np.all([setting.cell.beyond(i, part) <= 0 for i, part in enumerate(q)], axis=0)
            values = np.where(inside, setting.objective.values(setting, q), -np.inf)
            k = int(np.nan_to_num(values, nan=-np.inf).argmax())
            if not values[k] > proof.value + 1e-9 * max(1.0, abs(proof.value)):
                return None
            proof.value, posture = float(values[k]), np.hstack(q)[k]
            if not constrained:
                found.append(LocalOptimum(posture, proof.value, 1))
                with hushed():
                    found.extend(climbed(model, setting, SearchOutcome(), posture[None]).optima)
                proof.value = max(optimum.objective for optimum in found)
                attained(proof.value)
            return proof.value

        try:
            proof.run(setting.cell, model.arms, setting.placement, setting.objective, better)
        except StoppedError as stop:
            proof.reason = str(stop)
        kinds = "colliding or not, " if setting.bodies is not None else "allowed or not, "
        optima = tuple(sorted((*found, *outcome.optima), key=lambda optimum: -optimum.objective))
        return cls(
            setting, proof, time.perf_counter() - began, kinds if constrained else "",
            replace(outcome, optima=optima) if found else None,
        )  # fmt: skip

    def record(self, value: float) -> ProofRecord:
        """The record of the proof for the value of the answer in the end."""
        proof, slices = self.proof, self.proof.slices
        names, search = [arm.name for arm in self.setting.cell.arms], proof.search
        if search is None or not np.isfinite(search.highest):
            return unproved(proof.epsilon, proof.reason, self.seconds)
        bound, odd = max(search.highest, value), sum(each.odd for each in slices)
        sliced = [f"{s.slices} slices of {len(s.joints)} joints" for s in slices if s.joints]
        things, verb = ("self-motions", "meet") if sliced else ("postures", "gives")
        beyond = max(bound - value, proof.epsilon if proof.done else 0.0)
        statement = (
            f"no posture{',' * bool(self.kinds)} {self.kinds}on the "
            f"{' × '.join(str(each.count) for each in proof.motions)} {things} beats this by more "
            f"than {_rounded_up(beyond)}; {things}: all that "
            f"{' and '.join(dict.fromkeys(sliced)) or 'elimination'} {verb}, "
            + (f"{odd} counts odd: some may be missing" if odd else "no count odd")
            + (
                ""
                if proof.done
                else f" ({_rounded_up(proof.epsilon)} was asked for: {proof.reason})"
            )
        )
        return ProofRecord(
            epsilon=proof.epsilon, bound=bound, gap=bound - value, statement=statement,
            assumptions=ASSUMPTIONS, odd=odd, combinations=search.combinations,
            self_motions={n: m.count for n, m in zip(names, proof.motions, strict=True)},
            slices={n: s.slices for n, s in zip(names, slices, strict=True)},
            segments={n: len(s.ends) for n, s in zip(names, proof.segments, strict=True)},
            seconds=self.seconds,
        )  # fmt: skip


def unproved(epsilon: float, reason: str | None, seconds: float = 0.0) -> ProofRecord:
    """The record where nothing is proved."""
    return ProofRecord(
        epsilon=epsilon, bound=None, gap=None, statement=f"nothing is proved: {reason}",
        assumptions=(), self_motions={}, slices={}, odd=0, segments={}, combinations=0,
        seconds=seconds,
    )  # fmt: skip


def _rounded_up(value: float) -> str:
    """A number to two digits, ``1e-6``."""
    unit = 10.0 ** np.floor(np.log10(max(value, 1e-300)) - 1)
    return f"{np.ceil(value / unit - 1e-6) * unit:.2g}".replace("e-0", "e-")
