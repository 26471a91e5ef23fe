"""Searches for what torque limits decide: nothing that a sample has is missed."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import copose
from cells import closed_postures, planar, tables, toml
from copose.cell.cell import Cell
from copose.commands.command_line import main
from copose.objectives.payload import Payload
from copose.posture.model import PostureModel
from copose.posture.search import combinations
from copose.posture.search.ranking import judged
from copose.posture.search.screening import Screened
from copose.problem import parse
from copose.self_motion.projection import project
from test_torque_limits import SPACES, cell_of, postures

KINDS = {
    "acceleration": {"kind": "acceleration"},
    "several": {"kind": "acceleration"},
    "payload": {"kind": "payload"},
    "all-round": {"kind": "all-round"},
}


def objective(name: str, space: str) -> dict:
    m = {"spatial": 6, "planar-linear": 2}.get(space, 3)
    flat = space.startswith("planar")
    wanted = dict(KINDS[name])
    sides = np.eye(m)[: 2 if flat else 3]
    if name == "acceleration":
        wanted["direction"] = sides[-1].tolist()
    if name == "several":
        wanted["directions"] = [sides[0].tolist(), (-sides[-1]).tolist()]
    if name == "all-round":
        wanted["axes"] = ["x", "y"] if flat else ["x", "y", "z"]
    return wanted


def sampled(cell: dict, planner: copose.Planner, count: int) -> float:
    """The best of all pairs of closed postures that were drawn at random."""
    ready = Cell.of(parse(cell))
    one, other = (closed_postures(ready, i, 2048, seed=7)[:count] for i in range(2))
    names, best = [arm.name for arm in ready.arms], -np.inf
    for row in one:
        measured = planner.measure({names[0]: np.tile(row, (len(other), 1)), names[1]: other})
        values = np.where(np.isfinite(measured.objective), measured.objective, -np.inf)
        if measured.share is not None:
            values = np.where(measured.share <= 1, values, -np.inf)
        best = max(best, float(values.max()))
    return best


@pytest.mark.few(5)
@pytest.mark.parametrize("name", ["acceleration", "several", "payload"])
@pytest.mark.parametrize("space", SPACES)
def test_no_sampled_posture_is_better(space: str, name: str) -> None:
    cell = cell_of(space, objective=objective(name, space))
    planner = copose.Planner(parse(cell))
    best = sampled(cell, planner, 60)
    for seed in range(2):
        solution = planner.solve(seed=seed)
        assert solution.status == "solved" and solution.objective.after >= best
        assert copose.verify(parse(cell), solution) == ()
        assert solution.search.best_sample <= solution.objective.after


@pytest.mark.few(1)
@pytest.mark.parametrize("space", ["planar", "planar-linear"])
def test_all_round_is_the_distance_of_the_nearest_facet(space: str) -> None:
    """Against the sample, and against directional linear programs around the posture found."""
    cell = cell_of(space, objective=objective("all-round", space))
    planner = copose.Planner(parse(cell))
    solution = planner.solve(seed=1)
    assert solution.objective.after >= sampled(cell, planner, 25)
    assert solution.after.residual_radius == solution.objective.after
    around = copose.evaluate(parse(cell), solution.after.joints).after.exact_sets["linear"]
    corners = np.array(around.vertices)
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.sum(normals * corners, axis=1).min() == pytest.approx(solution.objective.after)


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", ["volume", "worst-direction", "payload"])
def test_what_must_be_held_is_held(kind: str) -> None:
    """Near the heaviest mass every answer holds the object, and none that does is better."""
    cell = tables("panda-heavy")
    cell["objective"] = {"kind": kind} | ({} if kind == "payload" else {"axes": ["x", "y", "z"]})
    cell["object"]["mass"] = 78.0
    planner = copose.Planner(parse(cell))
    best = sampled(cell, planner, 60)
    solution = planner.solve()
    shares = [share for arm in solution.after.static_torque.values() for share in arm]
    assert max(shares) <= 1 + 1e-6
    assert solution.objective.after >= best
    free = {key: value for key, value in cell.items() if key != "constraints"}
    assert copose.solve(parse(free)).objective.after >= solution.objective.after - 1e-7


def test_a_box_too_heavy_to_hold(tmp_path, monkeypatch, capsys) -> None:
    """Exit 3, with the joint that gives way and the mass that would be possible."""
    monkeypatch.chdir(tmp_path)
    cell = tables("panda-heavy")
    cell["object"]["mass"] = 90.0
    (tmp_path / "p.toml").write_text(toml(cell))
    assert main(["solve", "p.toml", "--quiet"]) == 3
    said = capsys.readouterr().err
    result = json.loads((tmp_path / cell["name"] / "result.json").read_text())
    assert result["status"] == "infeasible" and result["after"] is None
    assert "panda_joint" in said and "gives way" in result["reason"]
    possible = float(result["reason"].split("a mass of ")[1].split(" kg")[0])
    for mass, status in ((possible - 0.05, "solved"), (possible + 0.05, "infeasible")):
        cell["object"]["mass"] = mass
        assert copose.solve(parse(cell)).status == status


def test_what_is_too_heavy_is_said_to_be_so_among_bodies_that_keep_clear() -> None:
    cell = planar() | {"world": {"gravity": [0, -9.81]}}
    for arm in cell["arms"]:
        arm["torque_limits"] = [20.0] * len(arm["links"])
    cell["object"]["mass"] = 300.0
    cell["constraints"] = {"static_torque": True, "collision": True}
    solution = copose.solve(parse(cell))
    assert solution.status == "infeasible" and "gives way" in solution.reason
    cell["object"]["mass"] = 0.99 * float(solution.reason.split("a mass of ")[1].split(" kg")[0])
    assert copose.solve(parse(cell)).status == "solved"


def test_a_hold_that_no_sample_has_is_found(monkeypatch) -> None:
    """Where no combination of the sample holds the object, those that hold the most are climbed."""
    cell = tables("panda-heavy")
    cell["object"]["mass"] = 78.0
    best = copose.solve(parse(cell)).objective.after

    def none_held(machinery, setting, postures, near, screened, most):
        if any(constraint.torque_limited for constraint in machinery.feasibility.constraints):
            return Screened(screened.chosen[:0], screened.scores[:0], screened.combinations)
        return judged(machinery, setting, postures, near, screened, most)

    monkeypatch.setattr(combinations, "judged", none_held)
    solution = copose.solve(parse(cell))
    assert solution.status == "solved"
    shares = [share for arm in solution.after.static_torque.values() for share in arm]
    assert max(shares) <= 1 + 1e-6 and solution.objective.after > best - 0.5


def test_an_acceleration_that_no_posture_has() -> None:
    cell = cell_of("spatial", objective={"kind": "acceleration", "direction": [1, 0, 0, 0, 0, 0]})
    cell["object"]["mass"] = 500.0
    solution = copose.solve(parse(cell))
    assert (
        solution.status == "infeasible" and "no acceleration as it is asked for" in solution.reason
    )


def test_climbs_that_end_below_the_best_are_optima_too() -> None:
    """Where no body is in the way they are told of, and combined anew with the others."""
    search = copose.solve(parse(cell_of("planar", objective={"kind": "payload"}))).search
    assert sum(optimum.count for optimum in search.local_optima) > search.starts / 2
    assert "Below_Best" not in {failure.status for failure in search.failures}


@pytest.mark.parametrize("key", ["torque_limits", "gravity"])
def test_what_limits_need_is_asked_for(key: str) -> None:
    cell = cell_of("planar", objective={"kind": "payload"})
    if key == "gravity":
        del cell["world"]
        message = "world.gravity: is 0; payload needs gravity"
    else:
        del cell["arms"][1]["torque_limits"]
        message = r"arms\[1\] \(a2\).torque_limits: objective 'payload' needs a torque limit"
    with pytest.raises(copose.InputError, match=message):
        copose.check(parse(cell))
    cell["objective"] = {"kind": "volume"}
    after = copose.evaluate(parse(cell), copose.solve(parse(cell)).after.joints).after
    assert after.payload is None


def test_the_same_seed_gives_the_same_bits_and_a_moved_object_builds_nothing() -> None:
    cell = cell_of("spatial", objective=objective("acceleration", "spatial"))
    planner = copose.Planner(parse(cell))
    one, other = (planner.solve(seed=5).model_dump(exclude={"timing"}) for _ in range(2))
    assert one == other
    moved = {"position": [0.52, 0.02, 0.45]}
    cell["object"]["position"] = moved["position"]
    fresh = copose.solve(parse(cell)).objective.after
    assert planner.solve(object_pose=moved).objective.after == pytest.approx(fresh, rel=1e-9)


def beside(planner: copose.Planner, solution, count: int, scale: float) -> np.ndarray:
    """Objectives of closed postures around an answer."""
    machinery, setting = planner._model, planner._nominal
    rng = np.random.default_rng(0)
    parts = []
    arms = zip(machinery.arms, solution.after.joints.values(), strict=True)
    for i, (kernels, q) in enumerate(arms):
        near = np.array(q) + rng.normal(scale=scale, size=(count, len(q)))
        low, high = setting.lower[i], setting.upper[i]
        parts.append(project(kernels, near, setting.placement.goals[i], low, high)[0])
    return machinery.objectives(setting, np.hstack(parts))


@pytest.mark.few(3)
@pytest.mark.parametrize("name", ["acceleration", "payload", "all-round"])
@pytest.mark.parametrize("space", ["spatial", "planar"])
def test_answers_are_maxima_among_closed_postures_beside_them(space: str, name: str) -> None:
    """Optimality by the linear programs, or the facets, of postures around the answer."""
    planner = copose.Planner(parse(cell_of(space, objective=objective(name, space))))
    solution = planner.solve(seed=0, effort="low")
    for scale in (1e-3, 1e-2):
        values = beside(planner, solution, 150, scale)
        assert np.nanmax(values) <= solution.objective.after + 1e-6
        assert np.nanmin(values) < solution.objective.after - 1e-4


@pytest.mark.parametrize("space", ["spatial", "planar"])
def test_what_compares_accelerations_is_the_ellipsoid_about_the_centre(space: str) -> None:
    """At the score the least ‖T⁻¹τ‖ is √(2N/π), by the full equations of motion."""
    cell = cell_of(space, objective=objective("acceleration", space), ellipsoid={"gravity": True})
    truth, drawn = postures(cell, 4)
    ready = Cell.of(parse(cell))
    machinery = PostureModel(ready)
    setting = machinery.setting(ready)
    u, T = np.array(cell["objective"]["direction"]), truth.torque_limits()
    for joints in drawn:
        parts = [np.array(joints[arm.name])[None] for arm in ready.arms]
        sums = sum(machinery.terms(setting, i, q) for i, q in enumerate(parts))
        score = machinery.score.value(sums, setting.given)[0, 0]
        B, center = truth.constrained_dynamics(joints)
        least = np.linalg.norm(np.linalg.pinv(B * T) @ (score * u - center))
        assert least == pytest.approx(math.sqrt(2 * len(T) / math.pi), rel=1e-5)


@pytest.mark.parametrize("space", SPACES)
def test_what_compares_holds_is_the_least_norm(space: str) -> None:
    """The heaviest mass whose hold takes ‖T⁻¹τ‖ = √(2N/π), by least squares over wrenches."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 4)
    ready = Cell.of(parse(cell))
    rest = np.zeros(len(truth.rows))
    machinery = PostureModel(ready, Payload(ready.torque_limits, rest, ready.problem.space))
    setting = machinery.setting(ready)
    T = truth.torque_limits()
    for joints in drawn:
        parts = [np.array(joints[arm.name])[None] for arm in ready.arms]
        sums = sum(machinery.terms(setting, i, q) for i, q in enumerate(parts))
        mass = machinery.score.value(sums, setting.given)[0, 0]
        _, J, g, _, X, weight = truth.at_rest(joints)
        load = mass * weight / cell["object"]["mass"]
        h, *_ = np.linalg.lstsq(X, load, rcond=None)
        free = np.linalg.svd(X)[2][np.linalg.matrix_rank(X) :].T
        A = J.T / T[:, None]
        y, *_ = np.linalg.lstsq(A @ free, -(g / T + A @ h), rcond=None)
        least = np.linalg.norm(g / T + A @ (h + free @ y))
        assert least == pytest.approx(math.sqrt(2 * len(T) / math.pi), rel=1e-5)


def limited(kind: str, size: float, gravity: float = 0.0) -> copose.Solution:
    """Two planar arms with torque limits of some size."""
    cell = tables("paper-fig2")
    cell["world"] = {"gravity": [0.0, gravity]}
    cell["objective"] = {"kind": kind}
    if kind == "acceleration":
        cell["objective"]["direction"] = [0.6, 0.8]
    if kind == "worst-direction":
        cell["ellipsoid"] = {"torque_scaling": "limits"}
    for arm in cell["arms"]:
        arm["torque_limits"] = [3.0 * size, 2.0 * size, 1.0 * size]
    return copose.solve(parse(cell))


@pytest.mark.parametrize(
    ("kind", "sizes"), [("acceleration", (1e-3, 1e6)), ("worst-direction", (1e6,))]
)
def test_larger_limits_accelerate_as_much_more(kind: str, sizes: tuple[float, ...]) -> None:
    """In proportion, without gravity, and in the same posture."""
    one = limited(kind, 1.0)
    for size in sizes:
        other = limited(kind, size)
        assert other.objective.after / size == pytest.approx(one.objective.after, rel=1e-7)
        for name, q in one.after.joints.items():
            assert other.after.joints[name] == pytest.approx(q, abs=1e-3)


def test_placeholders_leave_no_part_for_gravity() -> None:
    """With limits of 1e6 gravity is a millionth of what is left without it."""
    heavy, light = (limited("acceleration", 1e6, gravity).objective.after for gravity in (-9.81, 0))
    assert heavy == pytest.approx(light, rel=1e-4) and heavy != light


@pytest.mark.parametrize("seed", [0, 1])
def test_limits_that_no_scale_fits_warn_nobody(seed: int) -> None:
    """Numbers beyond all others are no Python warnings: tests turn those into errors."""
    cell = tables("paper-fig2") | {"ellipsoid": {"torque_scaling": "limits"}}
    for arm in cell["arms"]:
        arm["torque_limits"] = [2e-12, 5e5, 3.0]
    assert copose.Planner(parse(cell)).solve(seed=seed).status in ("solved", "failed")
