"""Proofs: enclosures enclose, bounds are not exceeded, what is wrong is refused."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import copose
from cells import planar, random_cell, tables
from copose import progress
from copose.cell.cell import Cell
from copose.commands.command_line import main
from copose.posture.model import PostureModel
from copose.posture.search import global_search
from copose.posture.setting import Setting
from copose.problem import parse
from copose.progress import Watch
from copose.proof.arm_terms import ArmTerms
from copose.proof.intervals import Interval, inverse
from copose.proof.proof import Proof, unprovable
from copose.proof.segments import MotionSegments
from copose.proof.self_motions import SelfMotions
from copose.proof.taylor import Taylor, cosines_and_sines, inverse_model
from copose.proof.tubes import SelfMotionTubes
from copose.self_motion.projection import project
from copose.self_motion.sampling import ArmSample, ArmSampler
from copose.self_motion.slices.sliced_arm import SlicedArm
from reference import PROBLEMS

RNG = np.random.default_rng(20)


def problem(name: str, **changes: object) -> copose.Problem:
    return parse(tables(name) | changes)


def model_of(asked: copose.Problem) -> tuple[PostureModel, Setting]:
    model = PostureModel(Cell.of(asked))
    return model, model.setting(model.cell)


# Intervals and Taylor models.


def exact(a: np.ndarray) -> list:
    return [[Fraction(float(x)) for x in row] for row in a]


def test_products_of_intervals_enclose_exact_ones() -> None:
    for _ in range(20):
        a, b = RNG.normal(size=(1, 3, 4)) * 10.0 ** RNG.integers(-8, 8, (1, 3, 4)), None
        b = RNG.normal(size=(1, 4, 2)) * 10.0 ** RNG.integers(-8, 8, (1, 4, 2))
        product = Interval.exactly(a) @ Interval.exactly(b)
        x, y = exact(a[0]), exact(b[0])
        for i in range(3):
            for j in range(2):
                true = sum((x[i][k] * y[k][j] for k in range(4)), Fraction(0))
                off = abs(true - Fraction(float(product.mid[0, i, j])))
                assert off <= Fraction(float(product.rad[0, i, j]))
                assert product.rad[0, i, j] < 1e-14 * (np.abs(a) @ np.abs(b))[0, i, j]


def test_inverses_of_intervals_enclose_those_of_random_members() -> None:
    mid = RNG.normal(size=(50, 5, 5))
    rad = np.full_like(mid, 1e-3)
    Y, regular = inverse(Interval(mid, rad))
    assert regular.sum() > 20
    for _ in range(50):
        true = np.linalg.inv(mid + RNG.uniform(-1, 1, mid.shape) * rad)
        inside = np.abs(true - Y.mid) <= Y.rad * (1 + 1e-9)
        assert inside[regular].all()
    # A matrix that is singular within its radii is not called regular.
    singular = np.eye(3)[None] * np.array([1.0, 1.0, 1e-4])
    assert not inverse(Interval(singular, np.full((1, 3, 3), 1e-3)))[1][0]


def test_taylor_models_enclose_functions_along_a_curve() -> None:
    """A product of matrices with cosines, and its inverse, against values, slopes and curvatures
    by finite differences.
    """
    h, a, b, c = np.array([0.05]), *RNG.normal(size=(3, 1, 2))

    def angles(t: float) -> np.ndarray:
        return a + b * t + c * t**2

    parts = [Interval.exactly(x) for x in (a, b, c)]
    q = Taylor.of(parts, h)
    cosines, sines = cosines_and_sines(q)
    spread = np.array([[[1.0, 0.3], [0.2, -1.0]]])

    def matrix(t: float) -> np.ndarray:
        angle = angles(t)
        return (np.cos(angle)[..., None] * spread) @ (np.sin(angle)[..., None] * spread) + np.eye(2)

    M = (cosines[..., None] * spread) @ (sines[..., None] * spread) + np.eye(2)
    Y, regular = inverse_model(M)
    assert regular.all()
    for model, f in ((M, matrix), (Y, lambda t: np.linalg.inv(matrix(t)))):
        for t in np.linspace(-0.049, 0.049, 41):
            d = 1e-4
            slope, bend = (f(t + d) - f(t - d)) / (2 * d), (f(t + d) - 2 * f(t) + f(t - d)) / d**2
            for true, enclosed, slack in (
                (f(t), model.whole, 1e-12),
                (slope, model.slopes, 1e-6),
                (bend / 2, model.curvature, 1e-5),
            ):
                assert (np.abs(true - enclosed.mid) <= enclosed.rad + slack).all()
        assert np.abs(f(0.0) - model.value.mid).max() < 1e-14


# Terms of arms.


CASES = {
    "volume": ("two-panda-box", {}),
    "torque-optimal": ("xarm-bar", {}),
    "six joints": ("ur5", {}),
    "planar": ("paper-fig2", {}),
    "planar, rigid": ("two-planar-4r", {}),
    "velocity-volume": ("two-panda-box", {"objective": {"kind": "velocity-volume"}}),
    "force-volume": ("two-panda-box", {"objective": {"kind": "force-volume"}}),
}


@cache
def enclosed_arm(case: str) -> tuple[PostureModel, Setting, MotionSegments]:
    """Segments of the first arm of a case, bounded from both sides."""
    name, changes = CASES[case]
    asked = parse(random_cell(("ur5", "ur5"), "spatial", 4)) if name == "ur5" else None
    model, setting = model_of(asked or problem(name, **changes))
    cell, kernels, goal = model.cell, model.arms[0], setting.placement.goals[0]
    slices = SlicedArm(cell.arms[0], kernels, cell.system.space).at(goal)
    motions = SelfMotions.of(cell, kernels, 0, goal, slices)
    form = setting.objective.form
    tubes = SelfMotionTubes(cell.arms[0], cell.system.space, goal)
    terms = ArmTerms(tubes, form, setting.placement.ties[0])
    sides = [(k, upper) for k in range(form.n_terms) for upper in (False, True)]
    segments = MotionSegments(cell, 0, terms, motions.manifold, sides)
    pieces = motions.pieces
    segments.add(pieces[RNG.permutation(len(pieces))[:60]], 0.5)
    assert segments.lost == 0
    return model, setting, segments


def violations(case: str, count: int, seed: int) -> tuple[int, float]:
    """How many bounds at random postures of random segments are violated, and the least margin."""
    model, setting, segments = enclosed_arm(case)
    rng = np.random.default_rng(seed)
    kernels, goal = model.arms[0], setting.placement.goals[0]
    tie, m = setting.placement.ties[0], model.cell.system.space.m
    rows = rng.integers(0, len(segments.ends), count)
    ends, w = segments.ends[rows], rng.uniform(0, 1, (count, 1))
    free = np.full(kernels.n, np.inf)
    q, gaps = project(kernels, (1 - w) * ends[:, 0] + w * ends[:, 1], goal, -free, free)
    assert (gaps < 1e-9).all()
    # Where on the segment they are: along the tangent in its middle.
    middle, v, _ = segments.middles(ends)
    t = ((q - middle) * v).sum(axis=1)
    a, b = (((end - middle) * v).sum(axis=1) for end in (ends[:, 0], ends[:, 1]))
    part = np.where(b > a, (t - a) / np.maximum(b - a, 1e-300), 0.0)
    inside = (part >= 0) & (part <= 1)
    truth, (i, j) = kernels.terms(q, tie), np.triu_indices(m)
    failed, least = 0, np.inf
    for side, (term, upper) in enumerate(segments.sides):
        s = m * (m + 1) // 2
        G = np.zeros((count, m, m))
        G[:, i, j] = G[:, j, i] = truth[:, s * term : s * term + s]
        low, high = segments.bounds[side][..., rows]
        V = np.moveaxis((1 - part) * low + part * high, -1, 0)
        L = np.linalg.inv(np.linalg.cholesky(G))
        values = np.linalg.eigvalsh(L @ V @ L.swapaxes(1, 2))
        margin = (values[:, 0] - 1 if upper else 1 - values[:, -1])[inside]
        # Postures are closed to 1e-13, and eigenvalues known to about as much.
        failed += int((margin < -1e-10).sum())
        least = min(least, float(margin.min()))
    return failed, least


@pytest.mark.parametrize("case", CASES)
def test_bounds_hold_at_random_postures_of_segments(case: str) -> None:
    failed, least = violations(case, 400, 7)
    assert failed == 0, least


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_bounds_hold_at_very_many_postures(case: str) -> None:
    for seed in range(20):
        failed, least = violations(case, 800, seed)
        assert failed == 0, least


OBJECTIVES = (
    {"kind": "volume"},
    {"kind": "worst-direction"},
    {"kind": "isotropy"},
    {"kind": "task-compatibility", "directions": [
        {"direction": [1.0, 0, 0, 0, 0, 0], "weight": 1.0},
        {"direction": [0, 0, 1.0, 0, 0, 0], "weight": -0.7}]},
    {"kind": "volume", "axes": ["x", "y", "z"]},
)  # fmt: skip


@pytest.mark.parametrize(
    "objective", OBJECTIVES, ids=lambda o: f"{o['kind']}{'-axes' * (len(o) > 1)}"
)
@pytest.mark.parametrize("width", [0.02, 0.5])
def test_bounds_of_objectives_hold_on_whole_cells(objective: dict, width: float) -> None:
    """Sums between random vertices: whatever they are, and what lies above or below them."""
    _, setting = model_of(problem("two-panda-box", objective=objective))
    measure, a = setting.objective, len(setting.cell.problem.axes)
    sides = measure.bound_sides(sliced=a < 6)
    for _ in range(30):
        roots = RNG.normal(size=(2, 6, 6))
        low = [root @ root.T + 0.1 * np.eye(6) for root in roots]
        ends = [(V, V + width * (W @ W.T)) for V in low for W in [RNG.normal(size=(6, 6))]]
        above = 0.05 * np.eye(6)
        corners = np.array([[(x + y + (2 * above if upper else 0))[:a, :a, None]
                             for _, upper in sides] for x in ends[0] for y in ends[1]])  # fmt: skip
        bound = measure.upper_bounds(corners, np.zeros((a, a)))[0]
        for _ in range(30):
            u, v, w = RNG.uniform(size=3)
            G = sum((1 - t) * x + t * y for t, (x, y) in zip((u, v), ends, strict=True))
            G = G + 2 * w * above
            assert measure.of_grams(G[None, :a, :a])[0] <= bound + 1e-12


def test_torque_optimal_volume_is_bounded_on_cells() -> None:
    _, setting = model_of(problem("xarm-bar"))
    i, j = np.triu_indices(6)
    M_o = np.zeros((6, 6))
    M_o[i, j] = M_o[j, i] = setting.placement.inertia
    for _ in range(30):
        S, R = ([x @ x.T + np.eye(6) for x in RNG.normal(size=(2, 6, 6))] for _ in range(2))
        bent = [[V, V + 0.2 * W @ W.T] for V, W in zip(S, RNG.normal(size=(2, 6, 6)), strict=True)]
        corners = np.array([[(x + y)[..., None], (R[0] + R[1] * f)[..., None]]
                            for f, x in zip((1, 1.3), bent[0], strict=True)
                            for y in bent[1]])  # fmt: skip
        bound = setting.objective.upper_bounds(corners, M_o)[0]
        for u, v in RNG.uniform(size=(20, 2)):
            whole = sum((1 - t) * x + t * y for t, (x, y) in zip((u, v), bent, strict=True))
            sums = np.concatenate([whole[i, j], (R[0] + R[1] * (1 + 0.3 * u))[i, j]])
            value = setting.objective.values_of_sums(setting, sums[None])[0]
            assert value <= bound + 1e-10


# Whole proofs.


def run(asked: copose.Problem, value: float, epsilon: float) -> Proof:
    model, setting = model_of(asked)
    proof = Proof(value, epsilon)
    proof.run(model.cell, model.arms, setting.placement, setting.objective, lambda q: None)
    return proof


def test_the_shipped_answer_of_two_pandas_is_proved() -> None:
    """At a symmetric pose."""
    asked = problem("two-panda-box")
    solution = copose.solve(asked, prove=1e-6)
    proof = solution.search.proof
    assert proof.gap <= 1e-6 and proof.bound >= solution.objective.after
    assert proof.self_motions == {"left": 8, "right": 8} and proof.odd == 0
    assert proof.statement == (
        "no posture on the 8 × 8 self-motions beats this by more than 1e-6; self-motions: all that "
        "144 slices of 3 joints meet, no count odd"
    )
    assert_drawn(solution)


def assert_drawn(solution: copose.Solution) -> None:
    """The map of a proof is of the objective, and is part of the picture."""
    proof, found = solution.search.proof, solution.objective.after
    values = np.array(proof.map.values, dtype=float)
    shape = tuple(len(axis.self_motions) for axis in (proof.map.y, proof.map.x))
    assert values.shape == shape and np.nanmax(values) <= found + 1e-4 * abs(found)
    answer = proof.map.x.answer, proof.map.y.answer
    assert values[answer[::-1]] > found - 0.02
    # What was bounded last is where the answer is.
    assert np.abs(np.array(proof.map.last) - answer).max(axis=1).min() <= 1
    for axis, count in zip((proof.map.x, proof.map.y), proof.self_motions.values(), strict=True):
        assert {*axis.self_motions} <= {*range(1, count + 1)} and axis.length > 0
    figure = copose.draw(solution)
    plain = copose.draw(solution.model_copy(update={"search": None}))
    names = [ax.get_xlabel() for ax in figure.axes]
    assert (
        len(figure.axes) == len(plain.axes) + 2 and f"{proof.map.x.arm}: arc length, rad" in names
    )
    whole, part = figure.get_size_inches(), plain.get_size_inches()
    assert whole[1] > part[1]
    for ax, as_before in zip(figure.axes, plain.axes, strict=False):
        inches = ax.get_position(original=True).bounds[3] * whole[1]
        assert inches == pytest.approx(as_before.get_position(original=True).bounds[3] * part[1])


@pytest.mark.parametrize(
    "name", ["paper-fig2", pytest.param("two-panda-box", marks=pytest.mark.long)]
)
def test_a_best_that_is_too_low_is_refused(name: str) -> None:
    best = copose.solve(problem(name)).objective.after
    wrong = run(problem(name), best - 0.02, 1e-3)
    assert not wrong.done and wrong.search.highest - wrong.value > 0.0199
    assert wrong.reason is not None


def test_a_hidden_self_motion_changes_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = problem("two-panda-box")
    whole = copose.solve(asked)
    best = np.array(whole.after.joints["left"])
    together = global_search.sample_together

    def blind(samplers: Sequence[ArmSampler], *arguments: object) -> list[ArmSample]:
        pairs = zip(samplers, together(samplers, *arguments), strict=True)
        return [one_hidden(full) if sampler.i == 0 else full for sampler, full in pairs]

    def one_hidden(full: ArmSample) -> ArmSample:
        elbow = np.sign(full.closed[:, 0] - best[0] + 0.8)
        near = np.abs(full.closed - best).max(axis=1) < 1.5
        keep = ~near | (elbow < 0)
        count = int(keep.sum())
        return replace(full, closed=full.closed[keep], neighbours=np.zeros((count, 1), dtype=int))

    monkeypatch.setattr(global_search, "sample_together", blind)
    hidden = copose.solve(asked)
    assert hidden.objective.after < whole.objective.after - 1e-3
    mended = copose.solve(asked, prove=1e-5)
    assert mended.objective.after == pytest.approx(whole.objective.after, abs=1e-7)
    assert mended.search.proof.gap <= 1e-5


def test_verification_meets_self_motions_that_draws_miss(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every drawn posture is the same: only slices meet the other self-motions."""
    asked = parse(random_cell(("ur5", "ur5"), "spatial", 4))
    whole = copose.solve(asked)
    best = [np.array(q) for q in whole.after.joints.values()]

    def one(self: ArmSampler, rng: np.random.Generator, count: int) -> np.ndarray:
        if self.i not in known:
            known[self.i] = np.zeros(0)
            closed = sample(self, np.random.default_rng(0), 96, 8, 200, 0).closed
            apart = np.abs(np.angle(np.exp(1j * (closed - best[self.i])))).max(axis=1)
            known[self.i] = closed[apart.argmax()]
        if not len(known[self.i]):
            return draw(self, rng, count)
        return np.repeat(known[self.i][None], count, axis=0)

    known: dict[int, np.ndarray] = {}
    draw, sample = ArmSampler.draw, ArmSampler.sample
    monkeypatch.setattr(ArmSampler, "draw", one)
    blind = copose.solve(asked)
    assert blind.objective.after < whole.objective.after - 1e-3
    seen = copose.solve(asked, verify=True)
    assert not seen.search.verification.stands
    assert seen.objective.after == pytest.approx(whole.objective.after, abs=1e-7)


def test_an_arm_at_a_limit() -> None:
    solution = copose.solve(problem("baxter-box"), prove=1e-5)
    assert solution.search.proof.gap <= 1e-5
    limits = [limit for arm in solution.limits.values() for limit in arm]
    joints = [q for arm in solution.after.joints.values() for q in arm]
    assert any(
        min(abs(q - limit.lower), abs(q - limit.upper)) < 1e-7
        for q, limit in zip(joints, limits, strict=True)
    )


@pytest.mark.parametrize("name", ["paper-fig2", "two-planar-4r"])
def test_planar_cells_are_proved_by_closed_forms(name: str) -> None:
    solution = copose.solve(problem(name), prove=1e-8)
    assert solution.search.proof.gap <= 1e-8
    assert_drawn(solution)


def test_postures_of_six_joint_arms_are_an_exact_table() -> None:
    solution = copose.solve(parse(random_cell(("ur5", "ur5"), "spatial", 4)), prove=1e-8)
    proof = solution.search.proof
    assert proof.gap <= 1e-8 and "elimination gives" in proof.statement
    assert proof.map is None
    assert "postures beats" in proof.statement and proof.slices == {"arm0": 1, "arm1": 1}


def test_what_cannot_be_proved_says_why() -> None:
    free = copose.load(str(PROBLEMS / "panda-place-object.toml"))
    assert unprovable(*model_parts(free)) == "more than joints is free"
    payload = problem("panda-payload")
    assert "no bound of 'payload'" in unprovable(*model_parts(payload))
    lots = parse(planar(2, 4, "planar-linear"))
    proof = copose.solve(lots, effort="low", prove=1e-6).search.proof
    assert proof.statement == "nothing is proved: arm 'a1' has 2 degrees of freedom to spare"
    assert proof.gap is None and proof.bound is None


def model_parts(asked: copose.Problem) -> tuple:
    model, setting = model_of(asked)
    return model.cell, setting.objective


def test_an_epsilon_below_rounding_is_refused() -> None:
    with pytest.raises(copose.InputError, match="no number from 1e-09 on"):
        copose.solve(parse(planar()), prove=1e-12)


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """A limit that passes as soon as a stage begins, for the nth time; the stages that began."""

    def passes(words: str, nth: int = 1) -> list[str]:
        stages.clear()
        monkeypatch.setattr(Watch, "stage", begins)
        last[:] = words, nth
        return stages

    def begins(self: Watch, name: str, *counts: float | None) -> None:
        begin(self, name, *counts)
        stages.append(name)
        words, nth = last
        late.extend([1e6] * (sum(words in each for each in stages) == nth))

    late, stages, last, begin = list[float](), list[str](), [], Watch.stage
    clock = SimpleNamespace(perf_counter=lambda: time.perf_counter() + sum(late))
    monkeypatch.setattr(progress, "time", clock)
    return passes


@pytest.mark.parametrize("words", ["polishing", "slicing", "enclosing"])
def test_a_limit_that_ends_before_any_bound_says_why_nothing_is_proved(
    words: str, limited: Callable[..., list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Table and exit code of the command are as without a proof."""
    monkeypatch.chdir(tmp_path)
    command = ["solve", str(PROBLEMS / "paper-fig2.toml"), "--quiet"]
    assert main([*command, "-o", "r"]) == 0
    limited(words)
    assert main([*command, "-o", "p", "--prove", "1e-8", "--time-limit", "100"]) == 0
    without, with_proof = (json.loads(Path(f"{k}/result.json").read_text()) for k in "rp")
    assert words == "polishing" or with_proof["after"] == without["after"]
    assert without["search"]["proof"] is None
    proof = with_proof["search"]["proof"]
    assert proof["bound"] is None and proof["gap"] is None and proof["epsilon"] == 1e-8
    assert re.fullmatch(
        f"nothing is proved: stopped by the limit of 100 s while .*{words}.*", proof["statement"]
    )


@pytest.mark.parametrize("nth", [1, 3])
def test_a_proof_that_a_limit_ends_states_the_gap_that_it_reached(
    nth: int, limited: Callable[..., list[str]]
) -> None:
    stages = limited("gap", nth)
    solution = copose.solve(problem("paper-fig2"), prove=1e-8, time_limit=100.0)
    proof, gap = solution.search.proof, float(stages[-1].split("gap ")[1])
    assert solution.status == "solved" and "gap" in stages[-1]
    assert proof.gap == pytest.approx(gap, rel=0.1) and proof.gap > 1e-8
    assert proof.bound == proof.gap + solution.objective.after
    assert "(1e-8 was asked for: stopped by the limit of 100 s while proving" in proof.statement


def test_constraints_are_left_out_of_a_proof_and_it_says_so() -> None:
    constrained = tables("paper-fig2") | {"constraints": {"static_torque": True}}
    for arm in constrained["arms"]:
        arm["torque_limits"] = [100.0] * len(arm["links"])
    proof = copose.solve(parse(constrained), prove=1e-6).search.proof
    assert proof.statement.startswith("no posture, allowed or not, on the 1 × 1 self-motions")
