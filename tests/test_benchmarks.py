"""The benchmark's own parts: cases, known optima, peers, judging, tables."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import limits
import numpy as np
import paths
import pinocchio as pin
import proofs
import pytest
import run
import summary
from baselines_path import Tracker
from cases import NAMES, Case, case, ring_case
from enumerate_optima import known, same_posture
from jobs import moved, verdict
from numpy_model import NumpyModel
from peers import PEERS
from sampling import closed_starts, project, spread_out
from tables import report
from truth import Truth, truth_of

import copose
import path_problems
from copose.objectives.ellipsoid import Volume
from copose.proof.arm_terms import NormalGram
from copose.self_motion.slices.sliced_arm import SlicedArm
from reference import PROBLEMS

BENCHMARKS = PROBLEMS.parent / "benchmarks"


def test_every_shipped_problem_is_a_case() -> None:
    # What no other program can be asked: more than joints free, bodies in the way, or to stay in
    # reach.
    texts = {path.stem: path.read_text() for path in PROBLEMS.glob("*.toml")}
    asked = (".freedom", "[[cases]]", "collision = true", "reachable", "[path]")
    shipped = {name for name, text in texts.items() if not any(word in text for word in asked)}
    assert shipped <= {*NAMES, *limits.SHIPPED}
    assert set(known()) == set(NAMES)


def test_what_limits_decide_is_compared_with_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "DRAWN", 1024)
    monkeypatch.setattr(limits, "DENSE", 20)
    row = limits.line("panda-payload", "as shipped", 2)
    assert "| 2/2 | 2/2 |" in row
    # A search that reaches less than the sample is told.
    monkeypatch.setattr(limits, "sampled", lambda *_: 1e3)
    assert "| 0/2 | 2/2 |" in limits.line("panda-payload", "as shipped", 2)


@pytest.mark.parametrize("name", NAMES)
def test_a_case_is_read_and_its_best_known_posture_is_what_it_says(name: str) -> None:
    one, best = case(name), known()[name]
    assert one.problem.name == name
    truth = truth_of(one)
    for joints in [best["joints"], *best["equal"]]:
        judged = truth.judge(joints)
        assert judged.closure < 1e-8
        assert judged.beyond <= 0
        assert judged.objective == pytest.approx(best["objective"], abs=1e-6)
    assert truth.judge(best["joints"]).objective == pytest.approx(best["objective"], rel=1e-9)
    assert max(best["by_seed"].values()) == pytest.approx(best["objective"], abs=1e-9)
    if one.closed is not None:
        built = truth.judge(one.closed)
        assert built.closure < 1e-9
        assert built.objective <= best["objective"] + 1e-9


@pytest.mark.parametrize("count", [1, 5])
def test_arms_round_a_plate_hold_it(count: int) -> None:
    ring = ring_case(count)
    assert ring.closed is not None
    assert Truth(ring).judge(ring.closed).closure < 1e-9


@pytest.mark.parametrize("name", ["two-panda-box", "xarm-bar", "three-planar-plate", "pr2-dual"])
def test_the_vectorised_formulas_are_those_of_the_reference(name: str) -> None:
    truth = Truth(case(name))
    q = closed_starts(truth, 3, 0)
    assert len(q) == 3
    parts = np.split(q, np.cumsum([len(low) for low in truth.lower])[:-1], axis=1)
    sums = sum(truth.terms(i, *truth.arm_matrices(i, part)) for i, part in enumerate(parts))
    for row, value in zip(q, truth.values(sums), strict=True):
        judged = truth.judge(truth.split(row))
        assert judged.closure < 1e-9
        assert judged.beyond <= 0
        assert value == pytest.approx(judged.objective, abs=1e-8)


def test_projection_keeps_limits_and_spreads() -> None:
    truth = Truth(case("two-planar-4r"))
    drawn = np.random.default_rng(0).uniform(truth.lower[0], truth.upper[0], (200, 4))
    q, gap = project(truth, 0, drawn)
    closed = q[gap < 1e-10]
    assert len(closed) > 50
    assert np.all((q >= truth.lower[0]) & (q <= truth.upper[0]))
    assert 5 < len(spread_out(truth, 0, closed, 20)) <= 20


@pytest.mark.parametrize("name", ["two-panda-box", "paper-fig4", "z1-panda"])
def test_slopes_of_the_numpy_model(name: str) -> None:
    model = NumpyModel(case(name))
    q = closed_starts(model.truth, 1, 0)[0] + 0.01
    cost, gradient = model.cost_and_gradient(q)
    assert cost == pytest.approx(model.cost(q), rel=1e-12)
    step = 1e-5 * np.random.default_rng(0).normal(size=len(q))
    change = (model.cost(q + step) - model.cost(q - step)) / 2
    assert change == pytest.approx(gradient @ step, rel=1e-3, abs=1e-9)
    moves = (model.closure(q + step) - model.closure(q - step)) / 2
    assert moves == pytest.approx(model.closure_jacobian(q) @ step, abs=1e-10)


@pytest.mark.parametrize("method", PEERS)
def test_a_peer_converges_to_a_true_answer_and_follows_the_object(method: str) -> None:
    if not PEERS[method].available():
        pytest.skip(f"{PEERS[method].needs} is not installed")
    one = case("two-planar-4r")
    truth = truth_of(one)
    start = closed_starts(truth, 1, 0)[0]
    peer = PEERS[method]()
    peer.build(one)
    end = peer.local_solve(start)
    answer = verdict(one, truth.split(end.q), known()[one.name])
    assert end.converged
    assert answer["closure"] < 1e-6
    assert answer["beyond"] < 1e-9
    assert answer["objective"] > truth.judge(truth.split(start)).objective
    assert answer["objective"] <= known()[one.name]["objective"] + 1e-6
    pose = moved(one.problem.object.pose)
    again = peer.local_solve(end.q, pose, end)
    there = NumpyModel(one)
    there.place(pose)
    assert again.converged
    assert there.truth.judge(truth.split(again.q)).closure < 1e-6
    assert np.abs(again.q - end.q).max() < 0.3


def test_the_best_known_posture_is_recognised_up_to_whole_turns() -> None:
    one = case("xarm7-pair")
    truth, best = truth_of(one), known()[one.name]
    q = np.concatenate([best["joints"][name] for name in truth.names])
    assert same_posture(truth, q, q + 2 * np.pi)
    assert not same_posture(truth, q, q + 0.01)
    assert verdict(one, best["joints"], best)["same"]
    assert verdict(one, None, best)["objective"] is None


def test_copose_finds_a_known_optimum() -> None:
    solution = copose.solve(case("two-planar-4r").problem)
    best = known()["two-planar-4r"]["objective"]
    assert solution.objective.after == pytest.approx(best, abs=1e-6)


def test_hits_times_and_tables_of_a_run() -> None:
    best = known()["two-panda-box"]["objective"]
    row = {"seconds": 0.5, "wall": 0.5, "ok": True, "closure": 1e-9, "beyond": 0.0, "same": True}
    answers = [row | {"objective": best}, row | {"objective": best - 1e-3, "same": False}]
    answers += [row | {"objective": best, "closure": 1e-3}, row | {"objective": None, "ok": False}]
    record = {
        "answers": summary.columns(answers),
        "build_s": 0.1,
        "memory": 100.0,
        "memory_before": 90.0,
        "effort": "normal",
    }
    found = summary.found("two-panda-box", record)
    assert found is not None
    assert (found.runs, found.hits, found.same) == (4, 1, 1)
    assert found.success == (0.5, 0.5, 0.5)
    assert found.expected == pytest.approx(2.0)
    local = {"first": record["answers"], "again": record["answers"]}
    results = {
        "search": {"two-panda-box": {"copose": record, "slsqp": record}},
        "local": {"two-panda-box": {"copose": local, "slsqp": local}},
        "measure": {"two-panda-box": {"copose": {"per_second": 300.0},
                                      "numpy": {"per_second": 10.0}}},
        "arms": {
            str(k): {"copose": {"answers": summary.columns([row | {"seconds": k**2.0}])}}
            for k in (1, 2, 4)
        },
        "effort": {"two-panda-box": {"copose@low": {"error": "stopped"}}},
        "machine": {"cores": "2"}, "quick": True, "skipped": ["Drake"], "seconds": 60,
    }  # fmt: skip
    assert summary.slope(results)[2] == pytest.approx(2.0)
    measured = {what: value for what, _, value in summary.ratios(results)}
    assert measured["postures a second against a numpy loop, compiled"] == 30
    assert measured["local solve against SLSQP, compiled"] == 1
    page = report(results)
    assert "1/4" in page
    assert "stopped" in page
    assert "nan" not in page


def test_followers_keep_closed_and_within_limits_and_climb() -> None:
    tables = path_problems.gripped(20)
    tracker = Tracker(tables)
    truth = Truth(Case("gripped", "", tables))
    for start in tracker.starts(3, 0):
        for motion in (tracker.follow(start), tracker.follow(start, 1.0)):
            for q, time in zip(motion.q, tracker.time, strict=False):
                now = tracker.path.at(time)
                truth.place(pin.SE3(now.rotation, now.position))
                judged = truth.judge(truth.split(q))
                assert judged.closure < 1e-9 and judged.beyond <= 0
    still = Tracker(path_problems.along(path_problems.planar(), {}, {}, knots=20))
    for start in still.starts(3, 0):
        values = still.follow(start, 0.3).values
        assert np.all(np.diff(values) > -1e-12) and values[-1] > values[0] + 0.01
        assert np.ptp(still.follow(start).values) < 1e-9


def test_following_and_planning_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = path_problems.hinged(15)
    monkeypatch.setattr(paths, "carried", lambda knots: path_problems.hinged(knots))
    rows = paths.compared(tables, 2, (1.0, 10.0))
    assert len(rows) == 2 and all(one.won("mean") for one in rows)
    timings = [paths.measured(knots, 1) for knots in (10, 20)]
    assert -1 < paths.slope(timings) < 3
    text = paths.page({"1": timings}, rows, "mean", 1.0)
    assert "2 of 2 above both" in text and "nan" not in text


@pytest.mark.parametrize("robot", ["ur5", "xarm7"])
def test_postures_that_slices_miss_are_listed(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = proofs.completeness(robot, 2, 300, 0)
    assert seen.poses == 2 and seen.postures > 200 and not seen.misses
    whole = SlicedArm.at

    def short(self: SlicedArm, goal: np.ndarray) -> object:
        slices = whole(self, goal)
        return replace(slices, postures=slices.postures[:1])

    monkeypatch.setattr(SlicedArm, "at", short)
    misses = proofs.completeness(robot, 1, 300, 0).misses
    assert misses and all(("piece of 0 rad" in miss) == (robot == "ur5") for miss in misses)


def test_bounds_that_do_not_hold_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proofs, "TIMES", 2)
    monkeypatch.setattr(proofs, "PIECES", 40)

    def seen() -> proofs.Soundness:
        return proofs.soundness("volume", "paper-fig2", 300, 0)

    sound = seen()
    assert sound.bounds == 300 and sound.margin > 0 and sound.terms >= 600
    assert sound.violated == sound.terms_violated == 0
    bounds, vertices = Volume.upper_bounds, NormalGram.vertices
    monkeypatch.setattr(Volume, "upper_bounds", lambda *given: bounds(*given) - 0.05)
    assert seen().violated > 0 and seen().terms_violated == 0

    def higher(*given: object, upper: bool) -> tuple[np.ndarray, np.ndarray]:
        entries, off = vertices(*given, upper=upper)
        return 1.05 * entries, off

    monkeypatch.setattr(NormalGram, "vertices", higher)
    assert seen().terms_violated > 0


def test_wrong_names_are_answered_with_the_legal_ones() -> None:
    with pytest.raises(SystemExit, match="two-panda-box"):
        run.chosen("no-such", NAMES, NAMES)


def test_known_optima_are_finite_json() -> None:
    json.dumps(known(), allow_nan=False)
    assert Path(BENCHMARKS / "known_optima.json").read_text().endswith("}\n")
