"""The certificate of an answer: the record of a proof that nothing beats it by more than ε."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.poses import Array, Indices
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.search.global_search import climbed
from copose.posture.search.outcome import SearchOutcome
from copose.posture.setting import Setting
from copose.progress import StoppedError, attained, hushed
from copose.proof.proof import Proof
from copose.results import ProofMap, ProofMapAxis, ProofRecord

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

    def record(self, value: float, joints: Sequence[Array]) -> ProofRecord:
        """The record of the proof for the answer in the end: its value and joints, by arm."""
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
            seconds=self.seconds, map=self._map(joints, search.last),
        )  # fmt: skip

    def _map(self, joints: Sequence[Array], last: Indices, most: int = 80) -> ProofMap | None:
        """The objective over both arms' self-motions, so many postures of each, the answer, and the
        combinations of segments that were bounded last; None where they are no two curves.
        """
        setting, proof, terms, axes, rows = self.setting, self.proof, [], [], []
        if [motions.manifold.spare for motions in proof.motions] != [1, 1]:
            return None
        for i, motions in enumerate(proof.motions):
            middles = motions.pieces.mean(axis=1)
            within = setting.cell.beyond(i, middles) <= 0
            inside, parts = np.flatnonzero(within), np.cumsum(~within)
            chosen = inside[np.linspace(0, len(inside) - 1, min(most, len(inside))).astype(int)]
            points = np.exp(1j * middles[chosen])

            def nearest(q: Array, points: np.ndarray = points) -> Indices:
                return np.asarray((np.exp(1j * q) @ points.conj().T).real.argmax(axis=1))

            segments = proof.segments[i].ends.mean(axis=1)
            rows.append(nearest(segments)[last[:, i]])
            terms.append(motions.manifold.kernels.terms(middles[chosen], setting.placement.ties[i]))
            axes.append(ProofMapAxis(
                arm=setting.cell.arms[i].name, self_motions=motions.numbers[chosen].tolist(),
                cuts=tuple((np.flatnonzero(np.diff(parts[chosen])) + 1).tolist()),
                length=np.linalg.norm(np.diff(motions.pieces[inside], axis=1), axis=2).sum(),
                answer=nearest(joints[i][None])[0],
            ))  # fmt: skip
        sums = (terms[0][None] + terms[1][:, None]).reshape(-1, terms[0].shape[1])
        values = setting.objective.values_of_sums(setting, sums).reshape(len(terms[1]), -1)
        rounded = tuple(
            tuple(float(f"{x:.4g}") if np.isfinite(x) else None for x in row) for row in values
        )
        last = np.unique(np.stack(rows, axis=1), axis=0)
        return ProofMap(x=axes[0], y=axes[1], values=rounded, last=last.tolist())


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
