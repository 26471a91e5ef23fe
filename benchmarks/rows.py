"""The rows of `everything.py`: what copose does in each, and what it is compared with.

Seconds are of the processor, after building and with compiled kernels.
"""

from __future__ import annotations

import copy
import itertools
import os
import resource
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from baselines_path import GAINS, Tracker
from baselines_placement import direct, joint_program
from baselines_shortest import PlainShortest
from building import Tables
from cases import Case, case, ring_case
from jobs import moved
from own import Own
from paths import carried
from peers import PEERS
from sampling import closed_postures, closed_starts
from seeds import value_of
from truth import Truth, truth_of

import copose
from copose.motion import PathPlanner
from reference import PROBLEMS

Record = dict[str, Any]
MAIN = "two-panda-box"
_TRIED = ("ipopt-lbfgs", "slsqp-by-arm", "drake-snopt")


@dataclass(frozen=True)
class Amount:
    """How much is measured.

    Attributes:
        seeds: of copose's searches.
        budget: processor seconds of each baseline, and of copose's searches beyond the fifth.
    """

    seeds: int
    budget: float


def told(ends: Iterator[tuple[float | None, float]], budget: float) -> Record:
    """Values and processor seconds of what is tried, until so many seconds are spent."""
    values, seconds = list[float | None](), list[float]()
    for value, spent in ends:
        values.append(value)
        seconds.append(spent)
        if sum(seconds) > budget:
            break
    return {"values": values, "seconds": seconds}


def searches(tables: Tables, amount: Amount) -> Record:
    """Searches of copose with seeds 0, 1, …."""
    problem = copose.parse(tables)
    planner = copose.Planner(problem) if problem.path is None else PathPlanner(problem)
    planner.compile()

    def ends() -> Iterator[tuple[float | None, float]]:
        for seed in range(amount.seeds):
            began = time.process_time()
            if isinstance(planner, copose.Planner):
                answer: copose.Solution | copose.Motion = planner.solve(seed=seed)
            else:
                answer = planner.plan(seed=seed)
            yield value_of(answer, problem), time.process_time() - began

    budget = np.inf if amount.seeds <= 5 else amount.budget
    return told(ends(), budget)


def shipped(name: str) -> Tables:
    """The tables of a problem of `problems/`."""
    return tomllib.loads((PROBLEMS / f"{name}.toml").read_text())


def all_round_tables() -> Tables:
    """Two Pandas and the box, asked for accelerations in every linear direction."""
    return shipped(MAIN) | {"objective": {"kind": "all-round", "axes": ["x", "y", "z"]}}


def shortest_tables() -> Tables:
    """Two Pandas that carry the box in the shortest time that their torques allow."""
    tables = carried(30)
    tables["path"]["duration"] = "shortest"
    tables["constraints"] = {"dynamic_torque": True}
    for arm in tables["arms"]:
        arm["acceleration_limits"] = [10.0] * 7
    return tables


def sampled_facets(tables: Tables, budget: float) -> Record:
    """Random pairs of closed postures, all facets of each: the largest ball of the best."""
    truth = Truth(Case(tables["name"], "", tables))
    planner = copose.Planner(copose.parse(tables))
    planner.compile()
    arms = [closed_postures(truth, i, 2048, 0) for i in range(2)]
    rng = np.random.default_rng(0)

    def ends() -> Iterator[tuple[float | None, float]]:
        while True:
            began = time.process_time()
            pick = [q[rng.integers(0, len(q), 16)] for q in arms]
            values = planner.measure(dict(zip(truth.names, pick, strict=True))).objective
            spent = (time.process_time() - began) / len(values)
            yield from ((float(v) if np.isfinite(v) else None, spent) for v in values)

    return told(ends(), budget)


def peer(name: str, budget: float) -> Record:
    """A peer's local solves from closed starts."""
    problem = case(MAIN)
    truth = truth_of(problem)
    solver = PEERS[name]()
    solver.build(problem)

    def ends() -> Iterator[tuple[float | None, float]]:
        for seed in itertools.count(1):
            began = time.process_time()
            starts = closed_starts(truth, 256, seed)
            closing = (time.process_time() - began) / len(starts)
            for start in starts:
                began = time.process_time()
                end = solver.local_solve(start)
                spent = time.process_time() - began + closing
                judged = truth.judge(truth.split(end.q)) if end.converged else None
                yield judged and judged.objective, spent

    return told(ends(), budget)


def plain(amount: Amount) -> Record:
    """The plain search against peers from many starts."""
    available = [name for name in _TRIED if PEERS[name].available()]
    return {
        "own": searches(shipped(MAIN), amount),
        "baselines": {
            PEERS[name].name + ", many starts": peer(name, amount.budget) for name in available
        },
    }


def after_move(amount: Amount) -> Record:
    """A local solve from where the arms were, the object 5 mm aside."""
    problem = case(MAIN)
    truth = truth_of(problem)
    starts = closed_starts(truth, 4 * amount.seeds, 1)
    pose = moved(problem.problem.object.pose)
    solvers: dict[str, Any] = {"own": Own(problem, "normal")}
    for name in filter(lambda name: PEERS[name].available(), _TRIED):
        solvers[PEERS[name].name] = PEERS[name]()
        solvers[PEERS[name].name].build(problem)
    record: Record = {}
    for name, solver in solvers.items():
        spent = []
        for start in starts:
            first = solver.local_solve(start)
            warm = first[0] if name == "own" else first
            if not warm.converged:
                continue
            began = time.process_time()
            solver.local_solve(warm.q, pose, warm)
            spent.append(time.process_time() - began)
        record[name] = {"values": [None] * len(spent), "seconds": spent}
    own = record.pop("own")
    return {"own": own, "baselines": record}


def placement(name: str, amount: Amount) -> Record:
    """Placements against IPOPT from many starts and `direct`."""
    tables = shipped(name)
    divided = direct(tables, amount.budget)
    return {
        "own": searches(tables, amount),
        "baselines": {
            "IPOPT on the joint program, many starts": told(
                joint_program(tables, 0), amount.budget
            ),
            "SciPy direct over offsets, inner searches": told(iter(divided), np.inf),
        },
    }


def all_round(amount: Amount) -> Record:
    """The largest ball against a sample of which all facets are known."""
    tables = all_round_tables()
    return {
        "own": searches(tables, amount),
        "baselines": {"pairs sampled, all facets": sampled_facets(tables, amount.budget)},
    }


def shortest(amount: Amount) -> Record:
    """The shortest motion against a plain program with a free time."""
    tables = shortest_tables()
    baseline = told(PlainShortest(tables).ends(0), amount.budget)
    return {
        "own": searches(tables, amount),
        "baselines": {"plain program with a free time, many starts": baseline},
    }


def path(amount: Amount) -> Record:
    """A path of 50 knots against gradient projection with the best of its gains."""
    tables = carried()
    tracker = Tracker(tables)

    def ends() -> Iterator[tuple[float | None, float]]:
        for start in tracker.starts(256, 0):
            for gain in GAINS:
                began = time.process_time()
                followed = tracker.follow(start, gain)
                value = followed.aggregate(tracker.mode)
                if np.isfinite(value):
                    rates = np.diff(followed.q, axis=0) / np.diff(tracker.time)[:, None]
                    value -= tables["path"].get("smoothness", 0.01) * float((rates**2).mean())
                spent = time.process_time() - began
                yield value if np.isfinite(value) else None, spent

    return {
        "own": searches(tables, amount),
        "baselines": {"gradient projection, many starts and gains": told(ends(), amount.budget)},
    }


def command(amount: Amount) -> Record:
    """The whole command, warm, with its picture; the same from Python without; the imports."""
    problem, folder = str(PROBLEMS / "paper-fig2.toml"), os.environ.get("TMPDIR", "/tmp")
    solve = f"import copose; copose.solve(copose.load({problem!r}))"
    calls = {
        "own": ["-m", "copose", "solve", problem, "-o", f"{folder}/copose-everything", "--quiet"],
        "the same from Python, no picture": ["-c", solve],
        "import of numpy, casadi and pyplot": ["-c", "import numpy, casadi, matplotlib.pyplot"],
        "import of numpy and casadi": ["-c", "import numpy, casadi"],
    }
    # Bytecode is kept, as where copose is installed, whatever the shell of this process says.
    environment = os.environ | {"PYTHONPYCACHEPREFIX": f"{folder}/copose-bytecode"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    record: Record = {}
    for name, arguments in calls.items():
        whole = [sys.executable, *arguments]
        spent = []
        for _ in range(1 + min(5, amount.seeds)):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(whole, env=environment, check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        record[name] = {"values": [None] * (len(spent) - 1), "seconds": spent[1:]}
    own = record.pop("own")
    return {"own": own, "baselines": record}


def with_obstacles(count: int) -> Tables:
    """Two Pandas and the box, which keep clear of themselves and of balls around them."""
    tables = shipped(MAIN) | {"constraints": {"collision": True}}
    rng = np.random.default_rng(5)
    balls: list[Tables] = []
    while len(balls) < count:
        place = rng.uniform([-0.3, -0.9, 0.0], [1.3, 0.9, 1.2])
        # Not where the box, the hands and the bases are.
        if min(abs(place[1]), np.linalg.norm(place - [0.5, 0.0, 0.5])) > 0.45:
            shape = {"kind": "sphere", "radius": 0.04}
            name = f"ball{len(balls)}"
            balls.append({"name": name, "shape": shape, "position": place.tolist()})
    return tables | ({"obstacles": balls} if balls else {})


def with_cases(count: int) -> Tables:
    """The second Panda's base, and so many of three cases, and the same turned."""
    tables = shipped("panda-three-cases")
    cases = copy.deepcopy(tables["cases"])
    turned = [c | {"name": f"{c['name']} turned", "rpy": [0.0, 0.0, -0.2]} for c in cases]
    return tables | {"cases": [*cases, *turned][:count]}


@dataclass(frozen=True)
class Growth:
    """How seconds grow with something.

    Attributes:
        what: grows.
        sizes: in a full run; the first two in a quick one.
        tables: of a size.
    """

    what: str
    sizes: tuple[int, ...]
    tables: Callable[[int], Tables]

    def record(self, amount: Amount) -> Record:
        """Seconds by size; 5 seeds each, 2 at least, within the budget."""
        sizes = self.sizes if amount.seeds > 5 else self.sizes[:2]
        measured = {}
        for size in sizes:
            tables = self.tables(size)
            few = Amount(min(5, amount.seeds), amount.budget)
            measured[str(size)] = searches(tables, few)
        return {"growth": measured}


@dataclass(frozen=True)
class Row:
    """A row of the page.

    Attributes:
        what: is done.
        target: processor seconds to reach; None where growth is measured.
        measure: it.
        tables: of the problem that is profiled; None where there is none.
    """

    what: str
    target: float | None
    measure: Callable[[Amount], Record]
    tables: Callable[[], Tables] | None = None


def _placed(name: str, target: float) -> Row:
    return Row(f"`{name}`", target, partial(placement, name), partial(shipped, name))


_GROWING = {
    "arms": Growth("arms", (1, 2, 3, 4, 6), lambda count: ring_case(count).tables),
    "knots": Growth("knots", (25, 50, 100, 200), carried),
    "cases": Growth("cases", (1, 2, 3, 4), with_cases),
    "obstacles": Growth("obstacles", (1, 4, 16, 64), with_obstacles),
}
ROWS: dict[str, Row] = {
    "all-round": Row("`all-round`, two Pandas and the box, x y z", 0.6, all_round,
                     all_round_tables),
    "second-base": _placed("panda-second-base", 1.5),
    "place-object": _placed("panda-place-object", 3.0),
    "sliding-grasp": _placed("panda-sliding-grasp", 1.0),
    "three-cases": _placed("panda-three-cases", 5.0),
    "shortest": Row("`shortest`, torque and acceleration limits, two Pandas, 30 knots", 4.0,
                    shortest, shortest_tables),
    "path": Row("path of 50 knots, two Pandas", 0.25, path, carried),
    "plain": Row("the plain search, two Pandas", 0.012, plain, partial(shipped, MAIN)),
    "moved": Row("after the object moved 5 mm", 4e-4, after_move),
    "command": Row("`copose solve problems/paper-fig2.toml`, warm, with its picture", 0.7,
                   command),
    **{name: Row(f"growth in {each.what}", None, each.record) for name, each in _GROWING.items()},
}  # fmt: skip


def profile(row: Row, places: int = 5) -> list[tuple[str, float, float]]:
    """Where a search with seed 0 spends its time: functions, their own seconds and their share."""
    import cProfile
    import pstats

    if row.tables is None:
        return []
    problem = copose.parse(row.tables())
    planner: Any = copose.Planner(problem) if problem.path is None else PathPlanner(problem)
    planner.compile()
    run = planner.solve if problem.path is None else planner.plan
    run(seed=1)
    profiler = cProfile.Profile(time.process_time)
    profiler.runcall(run, seed=0)
    stats: Any = pstats.Stats(profiler)
    rows = sorted(stats.stats.items(), key=lambda item: -item[1][2])[:places]
    return [(_function(*key), each[2], each[2] / stats.total_tt) for key, each in rows]


def _function(file: str, line: int, name: str) -> str:
    if file == "~":
        return name
    where = Path(file)
    parts = where.parts[where.parts.index("copose") :] if "copose" in where.parts else (where.name,)
    return f"{'/'.join(parts[-3:])}:{line} {name}"
