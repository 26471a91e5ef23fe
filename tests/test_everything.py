"""The page of everything: its baselines, and how runs are compared."""

from __future__ import annotations

import itertools
import math

import everything
import numpy as np
import pytest
import rows
from baselines_placement import Divided, JointProgram, direct
from baselines_shortest import PlainShortest

import copose
from cells import tables
from path_problems import gripped


def free_base() -> dict:
    """Two planar 4-joint arms, the base of one free, in two cases."""
    cell = tables("two-planar-4r")
    cell["arms"][1]["freedom"] = {"base": {"x": [-0.1, 0.1], "y": [-0.1, 0.1]}}
    there = {"name": "there", "position": [0.4, 0.5], "weight": 2.0}
    return cell | {"cases": [{"name": "here"}, there]}


def held(cell: dict) -> dict:
    """The same with nothing free."""
    arms = [{k: v for k, v in arm.items() if k != "freedom"} for arm in cell["arms"]]
    return cell | {"arms": arms}


def test_the_joint_program_ends_in_optima_and_in_none_above_the_best() -> None:
    cell = free_base()
    best = copose.solve(copose.parse(cell), effort="low").objective.after
    ends = list(itertools.islice(JointProgram(cell).ends(0), 60))
    values = [value for value, _ in ends if value is not None]
    assert 6 <= len(values) < 60 and all(seconds > 0 for _, seconds in ends)
    assert best - 0.5 < max(values) <= best + 1e-6
    # With the base held where it is it is the posture program.
    del cell["cases"]
    best = copose.solve(copose.parse(held(cell)), effort="low").objective.after
    cell["arms"][1]["freedom"]["base"] = {"x": [-1e-9, 1e-9]}
    ends = list(itertools.islice(JointProgram(cell).ends(0), 60))
    assert max(v for v, _ in ends if v is not None) == pytest.approx(best, abs=1e-5)


def test_offsets_of_direct_are_those_of_the_file() -> None:
    bar = Divided(rows.shipped("panda-sliding-grasp"))
    assert bar.value(np.array([-0.126, 0.122])) == pytest.approx(1.571079, abs=1e-3)
    cases = rows.shipped("panda-three-cases")
    divided = Divided(cases)
    assert divided.bounds == [(-0.15, 0.2), (-0.3, 0.3)]
    best = copose.solve(copose.parse(held(cases)), effort="low").objective.after
    assert divided.value(np.zeros(2)) == pytest.approx(best, abs=1e-6)
    values = [value for value, _ in direct(rows.shipped("panda-sliding-grasp"), 1.0)]
    assert len(values) > 1 and max(v for v in values if v is not None) < 1.571079 + 1e-6


def test_the_plain_program_needs_as_long_as_copose() -> None:
    """Two planar arms whose torques decide; differences between knots make the rest."""
    cell = gripped(15, duration="shortest")
    cell["constraints"] = {"joint_margin": 0.05}
    for arm in cell["arms"]:
        arm["torque_limits"] = [14.0, 9.8, 4.2, 1.4]
        arm["velocity_limits"] = [30.0] * 4
        arm["acceleration_limits"] = [300.0] * 4
    motion = copose.plan(copose.parse(cell), effort="low")
    ends = itertools.islice(PlainShortest(cell).ends(0), 2)
    durations = [-value for value, _ in ends if value is not None]
    assert min(durations) == pytest.approx(motion.duration, rel=0.03)


def run(values: list[float | None], seconds: float) -> dict:
    return {"values": values, "seconds": [seconds] * len(values)}


def test_runs_are_compared_with_the_best_of_all() -> None:
    record = {
        "own": run([2.0, 2.0 - 1e-6, 1.9, 2.0, 2.0, 2.0], 0.5),
        "baselines": {"tries": run([None, 2.0, 1.0, 2.0], 3.0), "worse": run([1.0] * 9, 0.1),
                      "better": run([2.5], 100.0)},
    }  # fmt: skip
    assert everything.best_of(record) == 2.5
    del record["baselines"]["better"]
    lines = everything.compared("second-base", record)
    assert lines[0][1:] == ["copose", "500 ms", "1.5 s", "5/6", "2", "500 ms", "1"]
    assert lines[1][1:] == ["tries", "3 s", "", "2/4", "2", "6 s", "12"]
    assert lines[2][1:] == ["worse", "100 ms", "", "0/9", "1", "not in 900 ms", "–"]
    # Where nothing has a value one run is compared.
    timed = {"own": run([None] * 3, 2.0), "baselines": {"imports": run([None] * 3, 1.0)}}
    assert everything.compared("command", timed)[1][-2:] == ["1 s", "0.5"]


def test_the_page_is_made_of_what_is_kept() -> None:
    sizes = {str(n): run([1.0] * 3, 0.1 * n**1.5) for n in (1, 2, 4)}
    stored = {
        "arms": {"growth": sizes, "when": "2026-01-02 03:04"},
        "plain": {"own": run([1.0], 0.02), "baselines": {}, "when": "2026-01-02 03:05",
                  "profile": [("copose/a.py:1 f", 0.01, 0.5)]},
        "path": {"error": "not done", "when": "2026-01-01 00:00"},
    }  # fmt: skip
    page = everything.page(stored)
    assert "| arms | 1: 100 ms, 2: 283 ms, 4: 800 ms | 1.50 |" in page
    assert "| the plain search, two Pandas | copose | 20 ms | 12 ms | 1/1 | 1 | 20 ms | 1 |" in page
    assert "| `copose/a.py:1 f` | 10 ms | 50 % |" in page and "path: not done" in page
    assert "Measured 2026-01-01 00:00 … 2026-01-02 03:05." in page


def test_a_row_is_measured_and_profiled() -> None:
    small = rows.Row("small", 1.0, lambda amount: {
        "own": rows.searches(rows.shipped("paper-fig2"), amount), "baselines": {},
    }, lambda: rows.shipped("paper-fig2"))  # fmt: skip
    record = small.measure(rows.Amount(3, 5.0))
    assert record["own"]["values"] == pytest.approx([1.8224952484278525] * 3)
    places = rows.profile(small)
    assert len(places) == 5 and all(0 < share < 1 for _, _, share in places)
    assert [own for _, own, _ in places] == sorted((own for _, own, _ in places), reverse=True)
    assert any("copose/" in where for where, _, _ in places)


def test_problems_of_the_rows_are_read_and_grow() -> None:
    for cell in (rows.all_round_tables(), rows.shortest_tables(), rows.with_obstacles(4)):
        copose.parse(cell)
    assert len(rows.with_obstacles(16)["obstacles"]) == 16
    assert len(copose.parse(rows.with_cases(5)).cases) == 5
    budget = rows.told(iter([(1.0, 2.0), (None, 2.0), (3.0, 2.0)]), 3.0)
    assert budget == {"values": [1.0, None], "seconds": [2.0, 2.0]}
    assert math.isclose(sum(budget["seconds"]), 4.0)
