"""One measurement each, in a process of its own: clean memory figures, compiled or not.

    python benchmarks/jobs.py '{"job": "search", "case": "two-panda-box", "method": "copose"}'

prints one line of JSON. `run.py` starts these and sums up what they print.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, case, ring_case
from enumerate_optima import known, same_posture
from numpy_model import NumpyModel
from own import Own
from peers import PEERS
from programs import End
from sampling import closed_starts
from truth import Array, Truth, truth_of

from copose.poses import Pose

Record = dict[str, Any]

# How far the object moves before a solve from where it was, m.
MOVE = np.array([3e-3, 4e-3, 0.0])
_START_SEED = 1


def memory() -> float:
    """Peak resident memory of this process so far, MB.

    From /proc where there is one: what getrusage tells there may be the parent's.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def named(name: str) -> Case:
    """A case by its name, rings of arms included."""
    return ring_case(int(name.removeprefix("ring-"))) if name.startswith("ring-") else case(name)


def moved(pose: Pose) -> Pose:
    """The pose 5 mm aside, in the plane z = const."""
    return Pose.make(pose.position + MOVE, pose.rotation, pose.quaternion)


def within(count: int, seconds: float) -> Iterator[int]:
    """0, 1, … until the count or the time is spent; five at least."""
    began = time.perf_counter()
    for k in range(count):
        if k >= 5 and time.perf_counter() - began > seconds:
            return
        yield k


def verdict(case: Case, joints: dict[str, Any] | None, best: Record | None) -> Record:
    """An answer judged: objective, closure, limits, and whether it is the best known posture."""
    if joints is None:
        return {"objective": None, "closure": None, "beyond": None, "same": False}
    truth = truth_of(case)
    judged = truth.judge({name: list(q) for name, q in joints.items()})
    same = False
    if best is not None:
        q = _stacked(truth, joints)
        targets = [best["joints"], *best["equal"]]
        same = any(same_posture(truth, q, _stacked(truth, each)) for each in targets)
    return {
        "objective": _finite(judged.objective),
        "closure": _finite(judged.closure),
        "beyond": _finite(max(judged.beyond, 0.0)),
        "same": same,
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _stacked(truth: Truth, joints: dict[str, Any]) -> Array:
    return np.concatenate([np.asarray(joints[name], dtype=float) for name in truth.names])


def _own(case: Case, effort: str) -> tuple[Own, Record]:
    before = memory()
    own = Own(case, effort)
    facts = {"build_s": own.build_s, "compile_s": own.compile_s, "compiled": own.compiled}
    return own, facts | {"memory_before": before}


def search(
    case: Case, method: str, count: int, seconds: float, effort: str | None = None
) -> Record:
    """Global searches from seeds, or for a peer local solves from closed starts."""
    best = known().get(case.name)
    answers: list[Record] = []
    if method.startswith("copose"):
        own, facts = _own(case, effort or case.effort)
        for seed in within(count, seconds):
            began = time.perf_counter()
            joints, spent = own.search(seed)
            wall = time.perf_counter() - began
            answer = {"seconds": spent, "wall": wall, "ok": joints is not None}
            answers.append(answer | verdict(case, joints, best))
        return facts | {"answers": answers, "memory": memory(), "effort": effort or case.effort}
    truth = truth_of(case)
    began = time.perf_counter()
    starts = closed_starts(truth, count, _START_SEED)
    closing = (time.perf_counter() - began) / len(starts)
    before = memory()
    peer = PEERS[method]()
    began = time.perf_counter()
    peer.build(case)
    facts = {"build_s": time.perf_counter() - began, "memory_before": before}
    for k in within(len(starts), seconds):
        began = time.perf_counter()
        end = peer.local_solve(starts[k])
        answer = {"seconds": time.perf_counter() - began, "ok": end.converged}
        answers.append(answer | verdict(case, truth.split(end.q), best))
    return facts | {"answers": answers, "memory": memory(), "closing_s_per_start": closing}


def local(case: Case, method: str, count: int, seconds: float) -> Record:
    """Local solves from closed starts, and again from their ends after the object moved 5 mm."""
    truth = truth_of(case)
    starts = closed_starts(truth, count, _START_SEED)
    pose = moved(case.problem.object.pose)
    there = NumpyModel(case)
    there.place(pose)
    first, again = [], []
    solve = _solver(case, method)
    for k in within(len(starts), seconds):
        began = time.perf_counter()
        end, spent = solve(starts[k], None, None)
        wall = time.perf_counter() - began
        first.append(
            {"seconds": spent, "wall": wall, "ok": end.converged}
            | verdict(case, truth.split(end.q), None)
        )
        if end.converged:
            began = time.perf_counter()
            after, spent = solve(end.q, pose, end)
            wall = time.perf_counter() - began
            judged = there.truth.judge(truth.split(after.q))
            again.append(
                {"seconds": spent, "wall": wall, "ok": after.converged,
                 "objective": _finite(judged.objective), "closure": _finite(judged.closure),
                 "beyond": _finite(max(judged.beyond, 0.0))}
            )  # fmt: skip
    return {"first": first, "again": again}


_Local = Callable[[Array, Pose | None, End | None], tuple[End, float]]


def _solver(case: Case, method: str) -> _Local:
    """Where a local solve ends, and its seconds."""
    if method.startswith("copose"):
        return _own(case, "normal")[0].local_solve
    peer = PEERS[method]()
    peer.build(case)

    def solve(start: Array, pose: Pose | None, warm: End | None) -> tuple[End, float]:
        began = time.perf_counter()
        end = peer.local_solve(start, pose, warm)
        return end, time.perf_counter() - began

    return solve


def measure(case: Case, method: str, count: int, seconds: float) -> Record:
    """Postures of the whole system per second: Gram matrix, objective and closure."""
    truth = truth_of(case)
    few = closed_starts(truth, 64, _START_SEED)
    if not method.startswith("copose"):
        model = NumpyModel(case)
        began, done = time.perf_counter(), 0
        values = []
        while time.perf_counter() - began < seconds / 2 or done < len(few):
            q = few[done % len(few)]
            values.append(-model.cost(q))
            model.closure(q)
            done += 1
        return {"per_second": done / (time.perf_counter() - began), "values": values[: len(few)]}
    own, facts = _own(case, "normal")
    many = few[np.arange(count) % len(few)]
    edges = np.cumsum([len(low) for low in truth.lower])[:-1]
    postures = dict(zip(truth.names, np.split(many, edges, axis=1), strict=True))
    values = own.measure({name: q[:64] for name, q in postures.items()})
    rates = []
    for _ in within(20, seconds / 2):
        began = time.perf_counter()
        own.measure(postures)
        rates.append(count / (time.perf_counter() - began))
    return facts | {"per_second": float(np.median(rates)), "values": values.tolist()}


_JOBS: dict[str, Callable[..., Record]] = {"search": search, "local": local, "measure": measure}


def main() -> None:
    """Do the job that the first argument asks for and print its record."""
    wanted = json.loads(sys.argv[1])
    job, name = wanted.pop("job"), wanted.pop("case")
    record = _JOBS[job](named(name), **wanted)
    print("\n" + json.dumps(record, allow_nan=False))


if __name__ == "__main__":
    main()
