"""From the records of the jobs to the figures that tables and pictures show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from enumerate_optima import known
from peers import PEERS

Record = dict[str, Any]

LABELS = {
    "copose": "copose, compiled",
    "copose-vm": "copose, virtual machine",
    **{key: peer.name for key, peer in PEERS.items()},
}
TOLERANCES = (1e-4, 1e-6, 1e-8)
HIT = 1e-6
# Closure, m or rad, that an answer must have to count as one at all.
_TRUE = 1e-6
MAIN = "two-panda-box"


def columns(answers: list[Record]) -> Record:
    """Rows of a job as columns, rounded to what they are known to."""
    digits = {"seconds": 4, "wall": 4, "closure": 3, "beyond": 3, "objective": 13}
    found: Record = {}
    for key in answers[0] if answers else ():
        values = [row[key] for row in answers]
        if key in digits:
            values = [None if v is None else float(f"{v:.{digits[key]}g}") for v in values]
        found[key] = values
    return found


def _numbers(answers: Record, key: str) -> Any:
    return np.array([np.nan if v is None else v for v in answers.get(key, [])], dtype=float)


def true_at(answers: Record, tolerance: float) -> Any:
    """Which answers are said to be good and are closed and within the limits to a tolerance."""
    said = np.array(answers.get("ok", []), dtype=bool)
    closed = _numbers(answers, "closure") <= tolerance
    return said & closed & (_numbers(answers, "beyond") <= tolerance)


@dataclass(frozen=True)
class Found:
    """One method on one problem.

    Attributes:
        runs: seeds, or starts.
        success: share of true answers at each of ``TOLERANCES``.
        hits: runs that reached the best known objective to 1e-6.
        same: those of them that are the best known posture, or its mirror image.
        seconds: median of a run.
        expected: seconds to the optimum, mean time of a run over the hit rate; None without a hit.
        closing: seconds that closing a start took, none for a search; not in ``expected``.
        spent: seconds of all runs.
        closure: the worst of the true answers.
        gap: of the best answer below the best known objective; negative: it is better.
    """

    runs: int
    success: tuple[float, ...]
    hits: int
    same: int
    seconds: float
    expected: float | None
    closing: float
    spent: float
    closure: float
    gap: float

    @property
    def expected_with_closing(self) -> float | None:
        """Seconds to the optimum, the starts closed by vectorised numpy."""
        if self.expected is None:
            return None
        return self.expected + self.closing * self.runs / self.hits


def found(case: str, record: Record) -> Found | None:
    """The figures of a search job; None where it did not run."""
    answers = record.get("answers", {})
    if not answers:
        return None
    best = known()[case]["objective"] if case in known() else np.nan
    seconds, objective = _numbers(answers, "seconds"), _numbers(answers, "objective")
    true = true_at(answers, _TRUE)
    hit = true & (objective >= best - HIT)
    rate = hit.mean()
    return Found(
        runs=len(seconds),
        success=tuple(float(true_at(answers, t).mean()) for t in TOLERANCES),
        hits=int(hit.sum()),
        same=int((hit & np.array(answers["same"], dtype=bool)).sum()),
        seconds=float(np.median(seconds)),
        expected=float(seconds.mean() / rate) if rate else None,
        closing=float(record.get("closing_s_per_start", 0.0)),
        spent=float(seconds.sum()),
        closure=float(_numbers(answers, "closure")[true].max()) if true.any() else np.nan,
        gap=float(best - objective[true].max()) if true.any() else np.nan,
    )


def searches(results: Record) -> dict[str, dict[str, Found]]:
    """By problem and method."""
    gathered: dict[str, dict[str, Found]] = {}
    for case, methods in results["search"].items():
        for method, record in methods.items():
            figures = found(case, record)
            if figures is not None:
                gathered.setdefault(case, {})[method] = figures
    return gathered


def local_times(record: Record) -> tuple[float, float] | None:
    """Median seconds of the true answers from a closed start and after the object moved."""
    medians = []
    for part in ("first", "again"):
        answers = record.get(part, {})
        true = true_at(answers, _TRUE) if answers else np.zeros(0, dtype=bool)
        if not true.any():
            return None
        medians.append(float(np.median(_numbers(answers, "seconds")[true])))
    return medians[0], medians[1]


def slope(results: Record, method: str = "copose") -> tuple[list[int], list[float], float | None]:
    """Numbers of arms, median seconds of true answers, and the log–log slope over 2 … 8 arms."""
    arms, seconds = [], []
    for count, methods in sorted(results["arms"].items(), key=lambda item: int(item[0])):
        answers = methods.get(method, {}).get("answers", {})
        true = true_at(answers, _TRUE) if answers else np.zeros(0, dtype=bool)
        if true.any():
            arms.append(int(count))
            seconds.append(float(np.median(_numbers(answers, "seconds")[true])))
    several = [(k, s) for k, s in zip(arms, seconds, strict=True) if k >= 2]
    if len(several) < 2:
        return arms, seconds, None
    logs = np.log(np.array(several))
    return arms, seconds, float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])


def ratios(results: Record) -> list[tuple[str, str, float | None]]:
    """What is asked of copose, as (what, asked, measured); all within one run."""
    main = searches(results).get(MAIN, {})
    peers = {m: f for m, f in main.items() if m in PEERS and f.expected is not None}
    local = {m: local_times(r) for m, r in results["local"].get(MAIN, {}).items()}
    rates = {m: r.get("per_second") for m, r in results["measure"].get(MAIN, {}).items()}

    def faster(method: str, closing: bool) -> float | None:
        own = main.get(method)
        times = [(f.expected_with_closing if closing else f.expected) for f in peers.values()]
        best = min((time for time in times if time is not None), default=None)
        return best / own.expected if own and own.expected and best else None

    def over(method: str, others: tuple[str, ...], part: int) -> float | None:
        own = local.get(method)
        times = [times[part] for other in others if (times := local.get(other)) is not None]
        return min(times) / own[part] if own and times else None

    def rate(method: str) -> float | None:
        own, loop = rates.get(method), rates.get("numpy")
        return own / loop if own and loop else None

    best = "global search against the best peer's expected time"
    slsqp, ipopt = "local solve against SLSQP", "solve after 5 mm against plain IPOPT"
    return [
        (f"{best}, compiled", "≥ 25", faster("copose", True)),
        ("… from starts that cost the peer nothing", "", faster("copose", False)),
        (f"{best}, virtual machine", "≥ 6", faster("copose-vm", True)),
        ("… from starts that cost the peer nothing", "", faster("copose-vm", False)),
        (f"{slsqp}, compiled", "≥ 10", over("copose", ("slsqp",), 0)),
        ("… differenced arm by arm", "", over("copose", ("slsqp-by-arm",), 0)),
        (f"{slsqp}, virtual machine", "≥ 4", over("copose-vm", ("slsqp",), 0)),
        ("… differenced arm by arm", "", over("copose-vm", ("slsqp-by-arm",), 0)),
        (f"{ipopt}, compiled", "≥ 4", over("copose", ("ipopt-exact",), 1)),
        ("… with L-BFGS", "", over("copose", ("ipopt-lbfgs",), 1)),
        ("postures a second against a numpy loop, compiled", "≥ 30", rate("copose")),
        ("postures a second against a numpy loop, virtual machine", "≥ 2.5", rate("copose-vm")),
        ("log–log slope of the search over 2 … 8 arms", "≤ 2.2", slope(results)[2]),
    ]
