"""The best known optimum of every case, by enumeration that shares nothing with copose's planning.

Every arm is closed from thousands of random starts and thinned to postures that are spread out over
its self-motions. For two arms the objective is evaluated on all pairs; for more, arms are exchanged
one by one from many random combinations until none improves, and then all pairs of two arms are
looked at, the others as they are in the best combination. The best combinations that differ from
one another, and some random ones, are polished by IPOPT on the plain program; what is kept is
recomputed by Pinocchio. A run with another seed joins what is stored: the better optimum stays.

    python benchmarks/enumerate_optima.py [--cases a,b] [--seed 1]

writes `benchmarks/known_optima.json`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from cases import NAMES, Case, case
from programs import End, PlainProgram
from sampling import closed_postures, distances, spread_out
from truth import Array, Truth, truth_of

KNOWN = Path(__file__).with_name("known_optima.json")
_STARTS = {"normal": 6000, "high": 12_000}
_SPREAD = {"normal": 1200, "high": 2500}
_POLISHED = {"normal": 500, "high": 1000}
_SPREAD_MORE = 500
_EXCHANGES = 200
_RANDOM = 100
_APART = 0.25
_CLOSED = 1e-8
_SAME_JOINTS = 1e-3
# Optima nearer than this in the objective are equally good: mirror images of a symmetric cell.
_TIED = 1e-6
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


def best_pairs(
    truth: Truth, samples: list[Array], values: Array, count: int, arms: tuple[int, int] = (0, 1)
) -> list[Array]:
    """The best pairs of two arms' postures, no two of them near in both arms, as indices."""
    near = [distances(truth, i, samples[i][:, None], samples[i][None]) < _APART for i in arms]
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
                values = truth.values(terms[k] + _others(terms, chosen, (k,)))
                pick = int(np.argmax(values))
                if values[pick] > best + 1e-12:
                    best, chosen[k], settled = float(values[pick]), pick, False
        found[tuple(int(c) for c in chosen)] = best
    return [np.array(key) for key in sorted(found, key=lambda key: -found[key])]


def _others(terms: list[Array], chosen: Array, without: tuple[int, ...]) -> Array:
    kept = [terms[j][chosen[j]] for j in range(len(terms)) if j not in without]
    return np.sum(kept, axis=0)


def around(
    truth: Truth, samples: list[Array], terms: list[Array], best: Array, count: int
) -> list[Array]:
    """The best different combinations that share all but two arms' postures with ``best``."""
    pairs = list(itertools.combinations(range(len(terms)), 2))
    found = []
    for i, j in pairs:
        rest = _others(terms, best, (i, j))
        values = pair_values(truth, [terms[i] + rest, terms[j]])
        for a, b in best_pairs(truth, samples, values, count // len(pairs), (i, j)):
            chosen = best.copy()
            chosen[[i, j]] = a, b
            found.append(chosen)
    return found


def polish(case: Case, starts: list[Array]) -> list[tuple[Array, float]]:
    """Where IPOPT ends from stacked joints: those ends that hold the object within the limits."""
    truth = truth_of(case)
    program = PlainProgram(case, "limited-memory")
    kinked = case.kind in ("worst-direction", "isotropy")
    certain = PlainProgram(case, "exact") if kinked else None
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


def enumerate_case(case: Case, seed: int) -> dict[str, Any]:
    """The record of one case, as `known_optima.json` keeps it."""
    began = time.perf_counter()
    truth = truth_of(case)
    arms = range(len(truth.names))
    pair, starts_per_arm, count = len(arms) == 2, _STARTS[case.effort], _POLISHED[case.effort]
    closed = [closed_postures(truth, i, starts_per_arm, 20_000 + seed) for i in arms]
    spread = _SPREAD[case.effort] if pair else _SPREAD_MORE
    samples = [spread_out(truth, i, q, spread) for i, q in enumerate(closed)]
    terms = [truth.terms(i, *truth.arm_matrices(i, q)) for i, q in enumerate(samples)]
    rng = np.random.default_rng(20_000 + seed)
    if pair:
        values = pair_values(truth, terms)
        screened = best_pairs(truth, samples, values, count)
    else:
        screened = exchanged(truth, terms, rng)[:count]
        screened += around(truth, samples, terms, screened[0], count)
    top = np.sum([terms[k][screened[0][k]] for k in arms], axis=0)
    random = [np.array([rng.integers(len(q)) for q in samples]) for _ in range(_RANDOM)]
    starts = [np.concatenate([samples[k][row[k]] for k in arms]) for row in [*screened, *random]]
    ends = distinct(truth, polish(case, starts))
    q, objective = ends[0]
    lower, upper = np.concatenate(truth.lower), np.concatenate(truth.upper)
    return {
        "objective": objective,
        "joints": truth.split(q),
        "equal": [truth.split(other) for other, value in ends[1:] if value > objective - _TIED],
        "starts_per_arm": starts_per_arm,
        "closed": [len(found) for found in closed],
        "samples": [len(sample) for sample in samples],
        "combinations": math.prod(len(sample) for sample in samples),
        "all_combinations_screened": pair,
        "best_sample": float(truth.values(top[None])[0]),
        "polishes": len(starts),
        "local_optima": len(ends),
        "within_1e-3": sum(value > objective - 1e-3 for _, value in ends),
        "next_below": next((v for _, v in ends if v < objective - _TIED), None),
        "active_limits": int(np.sum((q - lower < 1e-5) | (upper - q < 1e-5))),
        "seconds": round(time.perf_counter() - began, 1),
        "by_seed": {str(seed): objective},
    }


def known() -> dict[str, Any]:
    """What is stored."""
    return json.loads(KNOWN.read_text()) if KNOWN.exists() else {}


def joined(case: Case, old: dict[str, Any] | None, new: dict[str, Any]) -> dict[str, Any]:
    """The record of the better run, with both runs' equal optima and objectives."""
    if old is None:
        return new
    truth = truth_of(case)
    better, other = (old, new) if old["objective"] >= new["objective"] else (new, old)
    equal = list(better["equal"])
    if other["objective"] > better["objective"] - _TIED:
        for joints in [other["joints"], *other["equal"]]:
            q = np.concatenate(list(joints.values()))
            kept = [np.concatenate(list(each.values())) for each in [better["joints"], *equal]]
            if not any(same_posture(truth, q, each) for each in kept):
                equal.append(joints)
    return better | {"equal": equal, "by_seed": old["by_seed"] | new["by_seed"]}


def main() -> None:
    """Enumerate the named cases and keep what is found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", help="comma-separated, default all", default=",".join(NAMES))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for name in arguments.cases.split(","):
        record = enumerate_case(case(name), arguments.seed)
        stored = known()
        stored[name] = joined(case(name), stored.get(name), record)
        ordered = {each: stored[each] for each in NAMES if each in stored}
        KNOWN.write_text(json.dumps(ordered, indent=1) + "\n")
        told = {k: v for k, v in record.items() if k not in ("joints", "equal")}
        print(name, told, len(stored[name]["equal"]), flush=True)


if __name__ == "__main__":
    main()
