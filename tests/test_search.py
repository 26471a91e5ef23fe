"""The global search: everything that closes is sampled, the best is found, the evidence is true."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import copose
from cells import closed_postures, planar, random_cell, tables, two_pandas
from copose.cell.cell import Cell
from copose.measurement.meter import Meter
from copose.posture.model import PostureModel
from copose.posture.reachable.components import manifold_of
from copose.posture.search.effort import EFFORTS
from copose.problem import parse
from copose.results import to_json
from copose.self_motion.curves.loops import Loops
from copose.self_motion.curves.tracing import follow
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.sampling import ArmSampler, sample_together
from reference import Problem as Truth


def machinery_of(cell: dict) -> tuple:
    machinery = PostureModel(Cell.of(parse(cell)))
    return machinery, machinery.setting(machinery.cell)


def sampled(cell: dict, i: int, seed: int = 0) -> tuple:
    machinery, setting = machinery_of(cell)
    sampler = ArmSampler(machinery.cell, machinery.arms[i], i, setting.placement.goals[i])
    return machinery.cell, sampler.sample(np.random.default_rng(seed), 128, 8, 1000, 4096)


def nearest(cell: Cell, i: int, points: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Distance of postures to the nearest of some points, whole turns aside."""
    offset = cell.nearest_turn(i, q[:, None] - points[None])
    return np.linalg.norm(offset, axis=2).min(axis=1)


LOOPS = [
    two_pandas(),
    planar(2, 4, "planar"),
    tables("baxter-box"),
    tables("xarm-bar"),
    random_cell(("pr2-left", "pr2-right"), "spatial", seed=1),
]


@pytest.mark.few(4)
@pytest.mark.parametrize("cell", LOOPS, ids=lambda cell: cell["name"])
@pytest.mark.parametrize("seed", [0, 1])
def test_every_posture_that_closes_is_near_a_sample(cell: dict, seed: int) -> None:
    """Random postures projected within limits, by another path, against the self-motions."""
    for i in range(2):
        ready, sample = sampled(cell, i, seed)
        closed = sample.closed
        assert np.all(closed >= ready.lower[i]) and np.all(closed <= ready.upper[i])
        random = closed_postures(ready, i, 1500, seed=7)
        assert len(random) > 50
        assert nearest(ready, i, closed, random).max() < 0.2
        # Evenly: no point has a crowd around it.
        assert len(closed) < 400


def test_six_joint_arms_have_isolated_postures_and_all_are_found() -> None:
    cell = random_cell(("ur5", "ur5"), "spatial", seed=0)
    for i in range(2):
        ready, sample = sampled(cell, i)
        random = closed_postures(ready, i, 3000, seed=5)
        assert nearest(ready, i, sample.closed, random).max() < 1e-6
        gaps = [nearest(ready, i, np.delete(sample.closed, k, axis=0), row[None])[0]
                for k, row in enumerate(sample.closed[1:], 1)]  # fmt: skip
        assert min(gaps) > 1e-3
        assert sample.branches is not None and sample.branches >= len(sample.closed) - 1


def test_a_piece_of_a_loop_that_limits_leave_is_found() -> None:
    """Limits that leave 0.03 rad of a self-motion: next to no random posture ends there."""
    cell = planar(1, 4, "planar")
    _, sample = sampled(cell, 0)
    q = sample.closed[len(sample.closed) // 2]
    cell["arms"][0]["position_limits"] = [[x - 0.015, x + 0.015] for x in q]
    for seed in range(5):
        _, piece = sampled(cell, 0, seed)
        assert len(piece.closed) > 0


def test_coverage_tells_self_motions_apart_as_exact_traces_do() -> None:
    """Of these eight self-motions some are near each other, and some are met rarely."""
    machinery, setting = machinery_of(tables("baxter-box"))
    cell, kernels, goal = machinery.cell, machinery.arms[0], setting.placement.goals[0]
    loops = Loops(cell, kernels, [0], goal[None])
    sampler = ArmSampler(cell, kernels, 0, goal)
    q, arms = loops.closed(sampler.draw(np.random.default_rng(3), 500), np.zeros(500, dtype=int))
    q, _ = project(kernels, q, goal, *np.full((2, 7), [[-np.inf], [np.inf]]))
    loops.add(q, arms)
    free = manifold_of(machinery, setting, [0])
    without = np.full((1, 7), np.inf)
    free = replace(free, lower=-without, upper=without, unlimited=np.ones((1, 7), dtype=bool))
    curves = 0
    while len(q):
        (curve,) = follow(free, q[:1])
        assert curve.loop
        q = q[1:][[curve.place(posture) is None for posture in q[1:]]]
        curves += 1
    assert loops.count() == curves == 8


def test_arms_are_sampled_side_by_side_as_each_by_itself() -> None:
    machinery, setting = machinery_of(two_pandas())
    assert machinery.arms[0] is machinery.arms[1]
    samplers = [
        ArmSampler(machinery.cell, kernels, i, setting.placement.goals[i])
        for i, kernels in enumerate(machinery.arms)
    ]
    options = 96, 8, 1000, 4096
    draws = [[np.random.default_rng([7, i]) for i in range(2)] for _ in range(2)]
    together = sample_together(samplers, draws[0], *options)
    for sampler, rng, both in zip(samplers, draws[1], together, strict=True):
        alone = sampler.sample(rng, *options)
        assert (both.tried, both.branches) == (alone.tried, alone.branches)
        assert len(both.closed) == pytest.approx(len(alone.closed), rel=0.1)
        assert both.closed[0] == pytest.approx(alone.closed[0], abs=1e-9)
        apart = nearest(machinery.cell, sampler.i, alone.closed, both.closed)
        assert apart.max() < 0.35


@pytest.mark.parametrize("seed", range(11))
def test_self_motions_of_three_links_are_counted_by_grashofs_rule(seed: int) -> None:
    """A tip that stays closes a four-bar linkage: two loops where the shortest and the longest bar
    are together shorter than the others, else one.
    """
    rng = np.random.default_rng(seed)
    *bars, ground = rng.uniform(0.15, 0.6, 4)
    short, second, third, longest = sorted([*bars, ground])
    assert longest < short + second + third and abs(short + longest - second - third) > 0.01
    cell = planar(1, 3)
    cell["object"]["position"] = [ground, 0.0]
    cell["arms"][0] |= {
        "links": [{"length": a, "mass": 1.0, "inertia": 0.03, "com": a / 2} for a in bars],
        "base": {"position": [0.0, 0.0]},
        "grasp": {"position": [0.0, 0.0]},
    }
    loops = 2 if short + longest < second + third else 1
    assert [sampled(cell, 0, draw)[1].branches for draw in range(4)] == [loops] * 4


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("cell", "objective"),
    [
        (two_pandas(), "volume"),
        (two_pandas("spatial-linear"), "volume"),
        (tables("xarm-bar"), "volume"),
        (tables("panda-carry"), None),
        (planar(3, 4, "planar"), "volume"),
        (random_cell(("panda", "ur5", "kinova"), "spatial-linear", seed=1), "volume"),
    ],
    ids=lambda value: value if not isinstance(value, dict) else value["name"],
)
def test_every_local_optimum_is_one_of_the_posture_program(cell: dict, objective) -> None:
    """Optimality conditions of IPOPT's program, with multipliers computed here."""
    machinery, setting = machinery_of(cell)
    lower, upper = setting.bounds
    rng = np.random.default_rng(0)
    starts = np.hstack([
        rng.permutation(sampled(cell, i)[1].closed)[:12] for i in range(len(machinery.arms))
    ])  # fmt: skip
    ends = machinery.polisher(setting).polish(starts)
    assert ends.converged.mean() > 0.9
    program = machinery.program
    x, p = program.expressions["x"], program.expressions["p"]
    f, g = program.expressions["f"], program.expressions["g"]
    conditions = ca.Function("conditions", [x, p], [ca.gradient(f, x), g, ca.jacobian(g, x)])
    numbers = np.concatenate([machinery.cell.parameters, machinery.objective.numbers])
    for q in ends.q[ends.converged][:8]:
        slope, closure, J = (np.array(value) for value in conditions(q, numbers))
        assert np.abs(closure).max() < 1e-10
        assert np.all(q >= lower) and np.all(q <= upper)
        free = (q > lower) & (q < upper)
        force = np.linalg.lstsq(J[:, free].T, -slope[free], rcond=None)[0]
        left = slope + J.T @ force
        scale = max(1.0, np.abs(force).mean() / 100)
        assert np.abs(left[free]).max() < 2e-9 * scale
        # The cost must not fall inwards from a limit.
        assert np.all(left[q <= lower] > -1e-8 * scale) and np.all(left[q >= upper] < 1e-8 * scale)
        # And no closed posture beside it is better.
        best = machinery.objectives(setting, q[None])[0]
        beside = [
            project(kernels, part + rng.normal(scale=2e-3, size=(40, len(part))), goal, low, high)
            for kernels, part, goal, low, high in zip(
                machinery.arms, machinery.cell.system.split(q), setting.placement.goals,
                setting.lower, setting.upper, strict=True,
            )
        ]  # fmt: skip
        closed = np.all([gap < CLOSED for _, gap in beside], axis=0)
        assert closed.sum() > 20
        others = np.hstack([ends_ for ends_, _ in beside])[closed]
        assert machinery.objectives(setting, others).max() < best + 1e-9


@pytest.mark.few(3)
@pytest.mark.parametrize(
    "cell",
    [
        two_pandas(), tables("xarm-bar"), tables("paper-fig4"), tables("panda-worst"),
        random_cell(("ur5", "ur5"), "spatial", seed=0),
        random_cell(("panda", "panda", "panda", "panda"), "spatial", seed=1),
    ],
    ids=lambda cell: cell["name"],
)  # fmt: skip
def test_seeds_agree_to_the_joint(cell: dict) -> None:
    planner = copose.Planner(parse(cell))
    answers = [planner.solve(seed=seed) for seed in range(4)]
    values = [answer.objective.after for answer in answers]
    assert max(values) - min(values) < 1e-6
    for name, q in answers[0].after.joints.items():
        for answer in answers[1:]:
            turned = [math.remainder(a - b, 2 * math.pi) for a, b in
                      zip(q, answer.after.joints[name], strict=True)]  # fmt: skip
            assert np.abs(turned).max() < 1e-4


def test_high_effort_finds_the_best_of_arms_with_more_to_spare() -> None:
    planner = copose.Planner(parse(planar(2, 5, "planar")))
    high = [planner.solve(seed=seed, effort="high").objective.after for seed in range(3)]
    low = [planner.solve(seed=seed, effort="low").objective.after for seed in range(3)]
    assert max(high) - min(high) < 1e-6 and max(low) <= max(high) + 1e-9


def test_the_evidence_is_what_happened() -> None:
    solution = copose.solve(parse(two_pandas()))
    search = solution.search
    assert search.seed == 0 and search.effort == "normal" and search.failures == ()
    counts = [sample.closed for sample in search.samples.values()]
    assert search.combinations == counts[0] * counts[1]
    assert search.gap == solution.objective.after - search.best_sample
    assert 0 <= search.gap < 0.02
    assert sum(optimum.count for optimum in search.local_optima) == search.starts
    values = [optimum.objective for optimum in search.local_optima]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(solution.objective.after, abs=1e-9)


def test_verification_says_whether_the_answer_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    planner = copose.Planner(parse(tables("paper-fig2")))
    solution = planner.solve(verify=True)
    again = solution.search.verification
    assert again.stands and again.seed != 0
    assert again.objective == pytest.approx(solution.objective.after, abs=1e-8)
    # A first search that sees nothing but the worst of what it polishes.
    from copose.posture.run import run as module

    honest = module.search

    def blind(machinery, setting, seed, effort):
        found = honest(machinery, setting, seed, effort)
        if seed == 0:
            object.__setattr__(found, "optima", found.optima[-1:])
        return found

    monkeypatch.setattr(module, "search", blind)
    mended = planner.solve(verify=True)
    assert not mended.search.verification.stands
    assert mended.objective.after == pytest.approx(solution.objective.after, abs=1e-8)
    assert any("missed this posture" in note for note in mended.notes)


def test_an_effort_may_have_options_of_its_own() -> None:
    planner = copose.Planner(parse(planar(2, 4)))
    combining = replace(EFFORTS["low"].combining, fewest_starts=2, surface_starts=1)
    few = replace(EFFORTS["low"], name="few", polished=2, combining=combining)
    search = planner.solve(effort=few).search
    assert search.effort == "few" and search.starts == 2
    twice = replace(few, combining=replace(combining, surface_starts=2))
    assert planner.solve(effort=twice).search.starts == 4
    assert planner.solve(effort="low").search.starts > 2


def test_a_moved_object_is_followed() -> None:
    cell = two_pandas()
    planner = copose.Planner(parse(cell))
    first = planner.solve()
    place = {"position": [0.503, 0.004, 0.5]}
    followed = planner.solve(object_pose=place, warm=first)
    cell["object"]["position"] = place["position"]
    truth = Truth(cell, {name: list(j) for name, j in followed.joint_names.items()})
    assert max(truth.at(followed.after.joints).closure.values()) < 1e-8
    factor, _ = truth.ellipsoid(followed.after.joints)
    radii = 1 / np.linalg.svd(factor, compute_uv=False)[::-1]
    assert np.allclose(followed.after.ellipsoid.radii, radii, rtol=1e-8)
    assert followed.search.effort == "local"
    assert max(followed.before.closure_error.values()) < 1e-8
    assert copose.verify(parse(cell), followed) == ()
    searched = copose.solve(parse(cell))
    assert followed.objective.after == pytest.approx(searched.objective.after, abs=1e-6)
    assert planner.solve(object_pose=place).objective.after == searched.objective.after
    by_joints = planner.solve(object_pose=place, warm=first.after.joints)
    assert (by_joints.after, by_joints.before) == (followed.after, followed.before)


def test_where_nothing_can_be_followed_all_is_searched() -> None:
    cell = planar(2, 4, "planar")
    planner = copose.Planner(parse(cell))
    straight = {arm["name"]: [0.0] * 4 for arm in cell["arms"]}
    for name in straight:
        straight[name][0] = 3.0
    solution = planner.solve(warm=straight, object_pose={"position": [0.0, 0.2], "angle": 0.1})
    assert solution.status == "solved"


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"object_pose": {"position": [0.0, 0.1, 0.0]}}, "object_pose.position"),
        ({"object_pose": {"rpy": [0, 0, 0]}}, "object_pose.rpy"),
        ({"object_pose": {"angle": math.nan}}, "object_pose.angle"),
        ({"warm": {"a1": [0.0] * 4}}, "joints.a2"),
        ({"warm": {"b": [0.0] * 4}}, "joints"),
        ({"effort": "huge"}, "effort"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"warm": {"a1": "abcd", "a2": [0.0] * 4}}, "joints.a1"),
        ({"warm": [1, 2]}, "joints"),
        ({"warm": {"a1": [0.0] * 4, "a2": [0.0] * 4}, "verify": True}, "verify"),
        ({"object_pose": [0, 0]}, "object_pose"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict, key: str) -> None:
    planner = copose.Planner(parse(planar(2, 4, "planar")))
    with pytest.raises(copose.InputError) as caught:
        planner.solve(**arguments)
    assert caught.value.key == key


@pytest.mark.parametrize("name", ["two-panda-box", "xarm-bar", "panda-carry", "push-x"])
def test_measure_is_the_meter_of_many(name: str) -> None:
    planner = copose.Planner(parse(tables(name)))
    ready = Cell.of(parse(tables(name)))
    meter = Meter(ready)
    postures = {arm.name: closed_postures(ready, i)[:20] for i, arm in enumerate(ready.arms)}
    measures = planner.measure(postures)
    truth = Truth(tables(name), {arm.name: list(arm.joint_names) for arm in ready.arms})
    for k in range(20):
        joints = {name: q[k] for name, q in postures.items()}
        factor, _ = truth.ellipsoid(joints)
        gram = factor.T @ factor
        assert np.allclose(measures.gram[k], gram, rtol=0, atol=1e-8 * np.abs(gram).max())
        for arm, error in truth.at(joints).closure.items():
            assert measures.closure_error[arm][k] == pytest.approx(error, abs=1e-8)
        one = meter.measure(ready, ready.given(joints))
        assert measures.objective[k] == pytest.approx(one.value, rel=1e-8, abs=1e-8)


def test_measure_says_what_is_open_and_what_is_singular() -> None:
    cell = planar(2, 4, "planar")
    planner = copose.Planner(parse(cell))
    straight = {arm["name"]: np.zeros((3, 4)) for arm in cell["arms"]}
    measures = planner.measure(straight)
    assert np.all(measures.closure_error["a1"] > 0.1)
    assert not np.isfinite(measures.objective).any()
    for wrong in ({"a1": np.zeros((3, 4))}, {"a1": np.zeros((2, 4)), "a2": np.zeros((3, 4))},
                  straight | {"a3": np.zeros((3, 4))}, straight | {"a1": np.zeros(4)},
                  straight | {"a1": "abc"}, [1]):  # fmt: skip
        with pytest.raises(copose.InputError):
            planner.measure(wrong)


@pytest.mark.parametrize("give", ["solution", "joints"])
def test_a_warm_posture_beyond_the_limits_is_not_the_answer(give: str) -> None:
    cell = planar(2, 4, "planar")
    for arm in cell["arms"]:
        arm["position_limits"] = [[-2.41, 2.41]] * 4
    wide = copose.solve(parse(cell))
    cell["constraints"] = {"joint_margin": 0.05}
    warm = wide if give == "solution" else wide.after.joints
    answer = copose.Planner(parse(cell)).solve(warm=warm)
    for q in answer.after.joints.values():
        assert np.abs(q).max() <= 2.36 + 1e-12


def test_a_warm_posture_of_another_problem_makes_a_result_that_can_be_read(tmp_path) -> None:
    other = copose.solve(parse(planar(2, 4, "planar-linear", objective={"kind": "isotropy"})))
    cell = planar(2, 4, "planar")
    answer = copose.Planner(parse(cell)).solve(warm=other)
    (tmp_path / "result.json").write_text(to_json(answer))
    assert copose.read_solution(tmp_path / "result.json") == answer
    assert copose.verify(parse(cell), answer) == ()


def test_an_optimum_beside_a_stretched_arm_is_found_with_high_effort() -> None:
    """Where a sample tells nothing of what is near it, arms climb alone from many."""
    cell = planar(2, 4, "planar-linear", ellipsoid={"resolution": "torque-optimal"})
    planner = copose.Planner(parse(cell))
    answers = [planner.solve(seed=seed, effort="high").objective.after for seed in range(2)]
    assert abs(answers[0] - answers[1]) < 1e-6


def test_no_posture_is_counted_twice() -> None:
    ready, sample = sampled(tables("baxter-box"), 0)
    places = ready.embedded(0, sample.closed)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(len(places))
    assert apart.min() > 1e-7


def test_a_tie_leaves_arms_where_they_start() -> None:
    """Mirrored at the line of bases and object every posture is worth the same."""
    cell = planar() | {"object": planar()["object"] | {"position": [0.5, 0.0]}}
    for arm, x in zip(cell["arms"], (0.0, 1.0), strict=True):
        arm["base"] = {"position": [x, 0.0]}
    best = copose.solve(copose.parse(cell)).after.joints
    for sign in (1.0, -1.0):
        for arm in cell["arms"]:
            arm["start"] = [sign * q for q in best[arm["name"]]]
        solution = copose.solve(copose.parse(cell))
        for name, q in best.items():
            np.testing.assert_allclose(solution.after.joints[name], sign * np.array(q), atol=1e-9)
