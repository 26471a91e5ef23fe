"""The best known optimum of every case, by enumeration that shares nothing with copose's planning.

Every arm is closed from thousands of random starts and thinned to postures that are spread out over
its self-motions. For two arms the objective is evaluated on all pairs; for more, arms are exchanged
one by one from many random combinations until none improves. The best combinations that differ from
one another, and some random ones, are polished by IPOPT on the plain program; what is kept is
recomputed by Pinocchio.

    python benchmarks/enumerate_optima.py [--cases a,b]      writes benchmarks/known_optima.json
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from programs import End, PlainProgram
from sampling import closed_postures, distances, spread_out
from truth import Array, Truth, truth_of

from cases import NAMES, Case, case

KNOWN = Path(__file__).with_name("known_optima.json")
SEED = 20_000
_STARTS = 6000
_SPREAD_PAIR, _SPREAD_MORE = 1200, 500
_EXCHANGES = 400
_POLISHED, _RANDOM = 300, 100
_APART = 0.25
_CLOSED = 1e-8
_SAME_JOINTS = 1e-3
_CHUNK = 200_000


def pair_values(truth: Truth, terms: list[Array]) -> Array:
    """The objective on all pairs of two arms' terms, (count_1, count_2)."""
    first, second = terms
    rows = max(1, _CHUNK // len(second))
    parts = []
    for begin in range(0, len(first), rows):
        sums = first[begin : begin + rows, None] + second[None]
        parts.append(truth.values(sums.reshape(-1, *second.shape[1:])).reshape(-1, len(second)))
    return np.concatenate(parts)


def best_pairs(truth: Truth, samples: list[Array], values: Array, count: int) -> list[Array]:
    """The best pairs of which no two are near in both arms, as indices."""
    near = [distances(truth, i, q[:, None], q[None]) < _APART for i, q in enumerate(samples)]
    left, chosen = values.copy(), []
    while len(chosen) < count:
        a, b = np.unravel_index(int(np.argmax(left)), left.shape)
        if not np.isfinite(left[a, b]):
            break
        chosen.append(np.array([a, b]))
        left[np.ix_(near[0][a], near[1][b])] = -np.inf
    return chosen


def exchanged(truth: Truth, terms: list[Array], rng: np.random.Generator) -> list[Array]:
    """Combinations that no exchange of one arm's posture improves, best first, as indices."""
    found: dict[tuple[int, ...], float] = {}
    for _ in range(_EXCHANGES):
        chosen = np.array([rng.integers(len(t)) for t in terms])
        best, settled = -np.inf, False
        while not settled:
            settled = True
            for k in rng.permutation(len(terms)):
                others = sum(terms[j][chosen[j]] for j in range(len(terms)) if j != k)
                values = truth.values(terms[k] + others)
                pick = int(np.argmax(values))
                if values[pick] > best + 1e-12:
                    best, chosen[k], settled = float(values[pick]), pick, False
        found[tuple(int(c) for c in chosen)] = best
    return [np.array(key) for key in sorted(found, key=lambda key: -found[key])]


def polish(case: Case, starts: list[Array]) -> list[tuple[Array, float]]:
    """Where IPOPT ends from stacked joints: those ends that hold the object within the limits."""
    truth = truth_of(case)
    program = PlainProgram(case, "limited-memory")
    certain = PlainProgram(case, "exact") if "kink" in _traits(case) else None
    ends = []
    for start in starts:
        end: End = program.solve(start)
        if not end.converged and certain is not None:
            end = certain.solve(start)
        if not end.converged:
            continue
        judged = truth.judge(truth.split(end.q))
        if judged.closure <= _CLOSED and judged.beyond <= 0 and np.isfinite(judged.objective):
            ends.append((end.q, judged.objective))
    return sorted(ends, key=lambda end: -end[1])


def _traits(case: Case) -> tuple[str, ...]:
    return ("kink",) if case.kind in ("worst-direction", "isotropy") else ()


def distinct(truth: Truth, ends: list[tuple[Array, float]]) -> list[tuple[Array, float]]:
    """Of ends that are the same posture, the best."""
    kept: list[tuple[Array, float]] = []
    for q, value in ends:
        if not any(same_posture(truth, q, other) for other, _ in kept):
            kept.append((q, value))
    return kept


def same_posture(truth: Truth, a: Array, b: Array, tolerance: float = _SAME_JOINTS) -> bool:
    """Whether two stacked postures agree up to whole turns."""
    edges = np.cumsum([len(low) for low in truth.lower])[:-1]
    parts = zip(np.split(a, edges), np.split(b, edges), strict=True)
    return all(distances(truth, i, x, y) < tolerance for i, (x, y) in enumerate(parts))


def enumerate_case(case: Case) -> dict[str, Any]:
    """The record of one case, as `known_optima.json` keeps it."""
    began = time.perf_counter()
    truth = truth_of(case)
    arms = range(len(truth.names))
    closed = [closed_postures(truth, i, _STARTS, SEED) for i in arms]
    spread = _SPREAD_PAIR if len(closed) == 2 else _SPREAD_MORE
    samples = [spread_out(truth, i, q, spread) for i, q in enumerate(closed)]
    terms = [truth.terms(i, *truth.arm_matrices(i, q)) for i, q in enumerate(samples)]
    rng = np.random.default_rng(SEED)
    if len(samples) == 2:
        values = pair_values(truth, terms)
        combined, screened = values.size, best_pairs(truth, samples, values, _POLISHED)
        best_sample = float(values.max())
    else:
        ends = exchanged(truth, terms, rng)
        combined, screened = _EXCHANGES, ends[:_POLISHED]
        best = sum(terms[k][ends[0][k]] for k in arms)
        best_sample = float(truth.values(best[None])[0])
    random = [np.array([rng.integers(len(q)) for q in samples]) for _ in range(_RANDOM)]
    starts = [np.concatenate([samples[k][row[k]] for k in arms]) for row in [*screened, *random]]
    ends = distinct(truth, polish(case, starts))
    q, objective = ends[0]
    lower, upper = np.concatenate(truth.lower), np.concatenate(truth.upper)
    return {
        "objective": objective,
        "joints": truth.split(q),
        "starts_per_arm": _STARTS,
        "closed": [len(found) for found in closed],
        "samples": [len(sample) for sample in samples],
        "combined" if len(samples) == 2 else "exchanges": combined,
        "best_sample": best_sample,
        "polishes": len(starts),
        "local_optima": len(ends),
        "within_1e-3": sum(value > objective - 1e-3 for _, value in ends),
        "values_within_1e-3": [value for _, value in ends if value > objective - 1e-3][:20],
        "next_below": next((v for _, v in ends if v < objective - 1e-6), None),
        "active_limits": int(np.sum((q - lower < 1e-5) | (upper - q < 1e-5))),
        "seconds": round(time.perf_counter() - began, 1),
    }


def known() -> dict[str, Any]:
    """What is stored."""
    return json.loads(KNOWN.read_text()) if KNOWN.exists() else {}


def main() -> None:
    """Enumerate the named cases and keep what is found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", help="comma-separated, default all", default=",".join(NAMES))
    for name in parser.parse_args().cases.split(","):
        record = enumerate_case(case(name))
        stored = known() | {name: record}
        ordered = {each: stored[each] for each in NAMES if each in stored}
        KNOWN.write_text(json.dumps(ordered, indent=1) + "\n")
        told = {k: v for k, v in record.items() if k not in ("joints", "values_within_1e-3")}
        print(name, told, flush=True)


if __name__ == "__main__":
    main()
