"""The largest ball of accelerations: facets by minors, bounds, its search and the certificate."""

from __future__ import annotations

from functools import partial
from itertools import combinations
from math import comb

import numpy as np
import pytest

import copose
from cells import closed_postures, planar, tables
from copose.capability.facet_normals import FacetNormals, cross
from copose.capability.residual_balls import ResidualBalls
from copose.objectives.ball_table import TableOptions, ranked
from copose.objectives.facet_ascent import AscentOptions, FacetAscent
from copose.objectives.quadratic_maximin import Quadratics, maximin
from copose.posture.search.effort import EFFORTS
from copose.posture.search.global_search import sampled
from copose.problem import parse
from test_limits_search import beside, objective
from test_torque_limits import SPACES, cell_of

GRAVITY = {"world": {"gravity": [0.0, -9.81]}}


def limited(arms: int, links: int, space: str = "planar", **extra: object) -> dict:
    """Planar arms with torque limits."""
    cell = planar(arms, links, space) | GRAVITY | extra
    for arm in cell["arms"]:
        arm["torque_limits"] = [20.0 - 4.0 * k for k in range(links)]
    cell["objective"] = {"kind": "all-round", "axes": ["x", "y"]}
    return cell


def ready(cell: dict, seed: int = 0, most: int = 12) -> tuple:
    """A planner, its sampled postures by arm, and the balls of all of them."""
    planner = copose.Planner(parse(cell))
    model, setting = planner._model, planner._nominal
    samples = sampled(model, setting, seed, EFFORTS["low"])
    q = [sample.closed[:: max(1, len(sample.closed) // most)] for sample in samples]
    return planner, q, model.objective._balls(setting, q)


def exact(planner: copose.Planner, q: list[np.ndarray], axes: tuple[int, ...]) -> float:
    """The radius of one posture by `ExactSet`, which decomposes every choice of generators."""
    capacity, _ = planner._nominal.loaded
    return capacity.exact_set(planner._nominal.cell, q, axes).residual_radius


def every(q: list[np.ndarray]) -> np.ndarray:
    return np.indices([len(part) for part in q]).reshape(len(q), -1).T


@pytest.mark.parametrize(("m", "n"), [(2, 3), (3, 7), (6, 9), (6, 14)])
def test_normals_are_perpendicular_to_their_generators(m: int, n: int) -> None:
    """All of them, each once: by a singular value decomposition of the generators."""
    V = np.random.default_rng(0).normal(size=(2, m, n))
    normals = FacetNormals.of(m, n)
    y = normals(V)
    assert len(normals.choices) == comb(n, m - 1) == y.shape[2]
    assert {tuple(c) for c in normals.choices} == set(combinations(range(n), m - 1))
    for k in range(0, len(normals.choices), 37):
        chosen = V[1][:, normals.choices[k]]
        truth = np.linalg.svd(chosen.T)[2][-1]
        unit = y[1, :, k] / np.linalg.norm(y[1, :, k])
        assert abs(unit @ truth) == pytest.approx(1, abs=1e-12)
        # The generalised cross product is as long as its factors' parallelepiped is large.
        volume = np.sqrt(np.linalg.det(chosen.T @ chosen))
        assert np.linalg.norm(y[1, :, k]) == pytest.approx(volume, rel=1e-9)
        assert cross(chosen.T) == pytest.approx(y[1, :, k], abs=1e-12)


@pytest.mark.parametrize("space", SPACES)
def test_radii_are_those_of_exact_sets(space: str) -> None:
    planner, q, balls = ready(cell_of(space, objective=objective("all-round", space)), most=4)
    axes = planner._model.objective.axes
    chosen = every(q)
    facets = balls.facets(chosen, 4)
    assert np.all(np.diff(facets.radii, axis=1) >= 0) and facets.radii[:, 0].max() > 0
    for rows, radius in zip(chosen, facets.radii[:, 0], strict=True):
        truth = exact(planner, [part[k] for part, k in zip(q, rows, strict=True)], axes)
        assert max(0.0, radius) == pytest.approx(truth, rel=1e-9, abs=1e-12)
    along, against = np.split(balls.tracked(chosen, facets.choices), 2, axis=1)
    assert np.minimum(along, against) == pytest.approx(facets.radii, rel=1e-9)


def test_no_vector_bounds_a_radius_too_low() -> None:
    """Random vectors, and normals of other postures' facets; each pair's own give its radius."""
    _, q, balls = ready(cell_of("spatial", objective=objective("all-round", "spatial")), most=6)
    chosen = every(q)
    facets = balls.facets(chosen)
    w = np.vstack([np.random.default_rng(1).normal(size=(64, 6)), facets.normals[:, 0]])
    table = balls.table(w)
    assert np.all(table.ravel() >= facets.radii[:, 0] - 1e-9)
    assert table.ravel() == pytest.approx(facets.radii[:, 0], rel=1e-9)
    assert balls.bounds(w, chosen) == pytest.approx(table.ravel(), rel=1e-12)
    assert balls.table(w[:64]).min() > facets.radii[:, 0].min() + 1e-3


def test_torques_within_limits_give_every_acceleration_of_the_ball_and_none_farther() -> None:
    """By the equations of motion: the support along random directions, over the slice."""
    from scipy.optimize import linprog

    planner, q, balls = ready(limited(2, 3), most=3)
    capacity, _ = planner._nominal.loaded
    rng = np.random.default_rng(0)
    for rows in every(q)[::3]:
        radius = balls.facets(rows[None]).radii[0, 0]
        posture = [part[k] for part, k in zip(q, rows, strict=True)]
        values = capacity._accelerations(
            np.concatenate(posture)[None], planner._nominal.cell.parameters
        )[0].reshape(-1, 3).T  # fmt: skip
        B, c, T = values[:, :-1], values[:, -1], np.concatenate(capacity.limits)
        reaches = []
        for angle in rng.uniform(0, 2 * np.pi, 60):
            u = np.array([np.cos(angle), np.sin(angle), 0.0])
            answer = linprog(
                np.append(np.zeros(len(T)), -1.0), A_eq=np.column_stack([B, -u]), b_eq=-c,
                bounds=[*zip(-T, T, strict=True), (None, None)],
            )  # fmt: skip
            reaches.append(answer.x[-1])
        if min(reaches) > 0:
            assert radius <= min(reaches) + 1e-9
            assert radius >= 0.95 * min(reaches)


@pytest.mark.parametrize("gap", [0.0, 0.02])
def test_the_bound_of_a_table_holds_for_all_its_entries(gap: float) -> None:
    """A dense enumeration by `ExactSet` never exceeds it, and it is as near as it says."""
    planner, q, balls = ready(limited(2, 4))
    answer = ranked(balls, None, TableOptions(first=4, at_once=4, gap=gap))
    truth = np.array(
        [exact(planner, [part[k] for part, k in zip(q, rows, strict=True)], (0, 1))
         for rows in every(q)]
    )  # fmt: skip
    assert answer.bound is not None and answer.combinations == len(truth) > 100
    assert truth.max() - 1e-9 <= answer.bound <= (1 + gap) * truth.max() + 1e-9
    first = np.ravel_multi_index(tuple(answer.chosen[0]), [len(part) for part in q])
    assert answer.scores[0] == pytest.approx(truth[first], abs=1e-9)
    assert truth[first] >= truth.max() / (1 + gap) - 1e-9
    assert np.all(np.diff(answer.scores) <= 0)


def test_what_is_not_allowed_is_no_answer_and_does_not_count_in_the_bound() -> None:
    planner, q, balls = ready(limited(2, 4))
    free = ranked(balls, None)

    def allowed(chosen: np.ndarray) -> np.ndarray:
        return (chosen.sum(axis=1) % 3 == 0) & np.any(chosen != free.chosen[0], axis=1)

    answer = ranked(balls, allowed, TableOptions(gap=0.0))
    assert allowed(answer.chosen).all() and len(answer.chosen)
    truth = max(
        exact(planner, [part[k] for part, k in zip(q, rows, strict=True)], (0, 1))
        for rows in every(q)[allowed(every(q))]
    )
    assert answer.scores[0] == pytest.approx(truth, abs=1e-9)
    assert answer.bound == pytest.approx(truth, abs=1e-9) and answer.bound < free.bound
    assert len(ranked(balls, lambda chosen: np.zeros(len(chosen), dtype=bool)).chosen) == 0


def test_the_largest_minimum_of_quadratics_is_that_of_a_grid() -> None:
    rng = np.random.default_rng(0)
    bend = rng.normal(size=(20, 2, 2, 6))
    functions = Quadratics(
        rng.uniform(0, 0.1, (20, 6)), rng.normal(size=(20, 2, 6)), bend + bend.swapaxes(1, 2)
    )
    region = np.full(20, 0.05)
    x, gain = maximin(functions, region)
    assert np.all(np.abs(x) <= 0.05 * (1 + 1e-12)) and np.all(gain >= 0) and gain.max() > 1e-3
    least = functions.value.min(axis=1)
    assert functions.values(x).min(axis=1) == pytest.approx(least + gain, abs=1e-12)
    axis = np.linspace(-0.05, 0.05, 81)
    grid = np.full(20, -np.inf)
    for point in np.array(np.meshgrid(axis, axis)).reshape(2, -1).T:
        grid = np.maximum(grid, functions.values(np.tile(point, (20, 1))).min(axis=1))
    assert np.all(least + gain >= grid - 1e-5)


@pytest.mark.parametrize("links", [4, 5])
def test_an_ascent_ends_at_maxima_and_a_race_in_some_of_them(links: int) -> None:
    """Of random closed postures beside the best end none is better; all end above their starts."""
    planner, q, _ = ready(limited(2, links))
    model, setting = planner._model, planner._nominal
    arms = [model.manifold(setting, i) for i in range(2)]
    count = min(map(len, q))
    start = [part[:count] for part in q]
    values = model.objectives(setting, np.hstack(start))
    alone = model.objective.ascended(setting, arms, start, race=False)
    raced = model.objective.ascended(setting, arms, start, race=True)
    ends = model.objectives(setting, np.hstack(alone))
    assert np.all(ends >= values - 1e-9)
    left = ~np.isnan(raced[0]).any(axis=1)
    best = model.objectives(setting, np.hstack([part[left] for part in raced])).max()
    assert left.sum() > 0 and values.max() < best <= ends.max() + 1e-7
    lower, upper = setting.bounds
    joints = np.hstack(alone)
    assert np.all((joints >= lower - 1e-12) & (joints <= upper + 1e-12))
    top = joints[ends.argmax()]
    rng = np.random.default_rng(0)
    for scale in (1e-3, 1e-2):
        near = [part + rng.normal(scale=scale, size=(200, links)) for part in model.split(top)]
        closed = np.hstack([project_onto(arm, part) for arm, part in zip(arms, near, strict=True)])
        assert np.nanmax(model.objectives(setting, closed)) <= ends.max() + 1e-7


def project_onto(arm: object, q: np.ndarray) -> np.ndarray:
    from copose.self_motion.projection import project

    return project(arm.kernels, q, arm.goals[0], arm.lower[0], arm.upper[0])[0]


def test_two_pandas_reach_the_best_known_ball_and_state_a_bound() -> None:
    cell = tables("two-panda-box")
    cell["objective"] = objective("all-round", "spatial")
    planner = copose.Planner(parse(cell))
    for seed in range(2):
        solution = planner.solve(seed=seed)
        assert solution.objective.after == pytest.approx(42.82427629, abs=1e-6)
        assert solution.after.residual_radius == solution.objective.after
        search = solution.search
        assert search.best_sample <= search.bound <= 1.021 * search.best_sample
        assert copose.verify(parse(cell), solution) == ()
    again = planner.solve(seed=1)
    assert again.model_dump(exclude={"timing"}) == solution.model_dump(exclude={"timing"})
    assert max(np.nanmax(beside(planner, solution, 100, scale)) for scale in (1e-4, 1e-2)) <= (
        solution.objective.after + 1e-7
    )


def test_only_a_table_has_a_bound() -> None:
    """Three arms' combinations are exchanged, and a volume is not bounded."""
    three = copose.solve(parse(limited(3, 3)), effort="low")
    assert three.status == "solved" and three.search.bound is None
    cell = limited(2, 3)
    assert copose.solve(parse(cell), effort="low").search.bound is not None
    cell["objective"] = {"kind": "volume"}
    assert copose.solve(parse(cell), effort="low").search.bound is None


def test_without_facets_to_enumerate_linear_programs_search(monkeypatch) -> None:
    cell = limited(2, 3)
    known = copose.solve(parse(cell), effort="low").objective.after
    monkeypatch.setattr(ResidualBalls, "enumerable", classmethod(lambda *_: False))
    solution = copose.solve(parse(cell), effort="low")
    assert solution.search.bound is None
    assert solution.objective.after == pytest.approx(known, rel=1e-6)


def test_static_torque_and_clearance_are_kept() -> None:
    for constraints in ({"static_torque": True}, {"collision": True}):
        cell = limited(2, 4, constraints=constraints)
        cell["object"]["mass"] = 4.0
        solution = copose.solve(parse(cell), effort="low")
        assert solution.status == "solved"
        assert copose.verify(parse(cell), solution) == ()
        free = {key: value for key, value in cell.items() if key != "constraints"}
        assert solution.objective.after <= copose.solve(parse(free)).objective.after + 1e-7
        assert solution.search.best_sample <= solution.search.bound + 1e-9


def test_an_ascent_keeps_joint_limits_to_the_last_bit() -> None:
    """The best posture of two Pandas is at one, and many ascents meet others on their way."""
    cell = tables("two-panda-box")
    cell["objective"] = objective("all-round", "spatial")
    planner, q, _ = ready(cell)
    model, setting = planner._model, planner._nominal
    arms = [model.manifold(setting, i) for i in range(2)]
    ends = np.hstack(model.objective.ascended(setting, arms, [part[:12] for part in q], race=False))
    lower, upper = setting.bounds
    assert np.all((ends >= lower) & (ends <= upper))
    assert np.any((ends <= lower + 1e-6) | (ends >= upper - 1e-6))
    assert max(np.abs(gap).max() for gap in gaps(model, setting, ends)) < 1e-9


def gaps(model: object, setting: object, q: np.ndarray) -> list[np.ndarray]:
    """Residuals of the closure by arm."""
    parts = zip(model.arms, model.split(q), setting.placement.goals, strict=True)
    return [kernels.residual(part, goal)[0] for kernels, part, goal in parts]


@pytest.mark.parametrize("kind", ["planar", "pandas"])
def test_no_enumeration_exceeds_the_bound_of_a_result(kind: str) -> None:
    """Of other closed postures than the search had, and of those that it had: by `ExactSet`."""
    cell, count = limited(2, 4), 24
    if kind == "pandas":
        cell, count = tables("two-panda-box"), 10
        cell["objective"] = objective("all-round", "spatial")
    planner = copose.Planner(parse(cell))
    solution = planner.solve(seed=3)
    setting, axes = planner._nominal, planner._model.objective.axes
    bound = solution.search.bound
    assert solution.objective.after <= bound
    samples = sampled(planner._model, setting, 3, EFFORTS["normal"])
    had = [sample.closed for sample in samples]
    others = [closed_postures(setting.cell, i) for i in range(2)]
    best = -np.inf
    for arms in (had, others):
        q = [part[:: max(1, len(part) // count)] for part in arms]
        best = max(best, *(
            exact(planner, [part[k] for part, k in zip(q, rows, strict=True)], axes)
            for rows in every(q)
        ))  # fmt: skip
    assert 0.8 * bound < best <= bound


def test_a_step_that_makes_the_ball_smaller_is_not_taken() -> None:
    """From a trust region in which the models are wrong: the next is smaller, and the facets that
    were nearest where the step led are followed too.
    """
    planner, q, _ = ready(limited(2, 4), most=24)
    model, setting = planner._model, planner._nominal
    arms = [model.manifold(setting, i) for i in range(2)]
    wide = AscentOptions(region=2.0, widest=2.0)
    ascent = FacetAscent(partial(model.objective._balls, setting), arms, wide)
    climbers = ascent._starting([part[: min(map(len, q))] for part in q])
    refused = 0
    for _ in range(6):
        after = ascent._stepped(climbers)
        radii = model.objectives(setting, np.hstack(after.q))
        assert np.maximum(after.value, 0) == pytest.approx(radii, abs=1e-9)
        assert np.all(after.value >= climbers.value)
        stood = np.all(np.hstack(after.q) == np.hstack(climbers.q), axis=1)
        assert after.region[stood] == pytest.approx(climbers.region[stood] / 4)
        refused += int(stood.sum())
        climbers = after
    assert refused >= 6
