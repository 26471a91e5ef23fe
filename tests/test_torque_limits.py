"""What torque limits allow against linear programs over torques alone, from Pinocchio's numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import copose
from cells import closed_postures, planar, tables, two_pandas
from copose.capability.contact_limits import inner_polyhedron
from copose.capability.linear_programs import maximise_first
from copose.cell.cell import Cell
from copose.measurement.meter import Measurement, Meter
from copose.measurement.torque_limits import TorqueLimitReport
from copose.posture.model import PostureModel
from copose.problem import parse
from reference import Problem as Truth
from reference import pose

SPACES = ["spatial", "spatial-linear", "planar", "planar-linear"]
EXACT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def cell_of(space: str, arms: int = 2, **more: object) -> dict:
    """Two Pandas, or planar arms that work against gravity."""
    if space.startswith("spatial"):
        return two_pandas(space) | more
    cell = planar(arms, 4, space)
    cell["world"] = {"gravity": [0.0, -9.81]}
    for arm in cell["arms"]:
        arm["torque_limits"] = [30.0, 25.0, 20.0, 15.0]
    return cell | more


def postures(cell: dict, count: int, seed: int = 0) -> tuple[Truth, list[dict]]:
    ready = Cell.of(parse(cell))
    K = len(ready.arms)
    samples = [closed_postures(ready, i, 256, seed) for i in range(K)]
    names = [arm.name for arm in ready.arms]
    truth = Truth(cell, {arm.name: list(arm.joint_names) for arm in ready.arms})
    return truth, [dict(zip(names, (s[k] for s in samples), strict=True)) for k in range(count)]


def measurements(cell: dict, drawn: list[dict]) -> list[Measurement]:
    """Postures as results state them, of what the problem asks for."""
    ready = Cell.of(parse(cell))
    meter = Meter(ready)
    return [meter.measure(ready, ready.given(joints)) for joints in drawn]


def farthest_of_torques(
    truth: Truth,
    joints: dict,
    fixed: np.ndarray,
    per_t: np.ndarray,
    load: np.ndarray,
    load_per_t: np.ndarray,
) -> float | None:
    """Max t over shares of torques: contact wrenches follow from the forward dynamics of every arm.

    h = Λ(J M⁻¹(τ − g) − Wᵀa), a = fixed + per_t t, and X h = load + load_per_t t.
    """  # fmt: skip
    M, J, g, W, X, _ = truth.at_rest(joints)
    T = truth.torque_limits()
    back = J @ np.linalg.inv(M)
    inertia = np.linalg.inv(back @ J.T)
    A = np.column_stack([X @ inertia @ back * T, -X @ inertia @ W.T @ per_t - load_per_t])
    b = load + X @ inertia @ (back @ g + W.T @ fixed)
    # Where contacts cannot exert a moment at all its row is empty, and must be.
    scale = np.abs(A[:, :-1]).max(axis=1)
    kept = scale > 1e-9 * scale.max()
    assert np.allclose(b[~kept], 0, atol=1e-9 * np.abs(b).max())
    A, b = A[kept] / scale[kept, None], b[kept] / scale[kept]
    size = np.abs(A[:, -1]).max()
    A[:, -1] /= size
    cost = np.zeros(len(T) + 1)
    cost[-1] = -1.0
    bounds = [*((-1.0, 1.0) for _ in T), (None, None)]
    answer = linprog(cost, A_eq=A, b_eq=b, bounds=bounds, options=EXACT)
    return float(answer.x[-1] / size) if answer.success else None


def heaviest_of_wrenches(truth: Truth, joints: dict, motion: np.ndarray | None = None) -> float:
    """Max kg over contact wrenches, with q̈ = 0 or q̈ = J⁺Wᵀa: −T ≤ M q̈ + g + Jᵀh ≤ T."""
    M, J, g, W, X, weight = truth.at_rest(joints)
    a = np.zeros(len(truth.rows)) if motion is None else motion
    fixed = g + M @ np.linalg.pinv(J) @ W.T @ a
    per_kg = (weight + padded(truth.M_o @ a, len(weight))) / truth.tables["object"]["mass"]
    # Columns are the mass and the wrenches over 100 N and 100 N·m.
    T, push = truth.torque_limits(), 100 * J.T
    A = np.column_stack([np.zeros(2 * len(T)), np.vstack([push, -push]) / np.tile(T, 2)[:, None]])
    b = np.concatenate([1 - fixed / T, 1 + fixed / T])
    gripped = bearing(truth)
    A = np.vstack([A, np.column_stack([np.zeros(len(gripped)), 100 * gripped])])
    b = np.concatenate([b, np.ones(len(gripped))])
    cost = np.zeros(A.shape[1])
    cost[0] = -1.0
    answer = linprog(
        cost, A, b, np.column_stack([-per_kg / 100, X]), np.zeros(len(weight)), (None, None),
        options=EXACT,
    )  # fmt: skip
    assert answer.success
    return float(answer.x[0])


def bearing(truth: Truth) -> np.ndarray:
    """Rows of what grips of two arms of six bear, of wrenches in world axes: at most 1."""
    rows = [np.zeros((0, len(truth.rows) * len(truth.tables["arms"])))]
    for i, table in enumerate(truth.tables["arms"]):
        turn = pose(table.get("base", {})).rotation.T if "grip" in table else np.eye(3)
        for k, most in enumerate(table.get("grip", {}).values()):
            normals, depth = inner_polyhedron(3)
            row = np.zeros((len(normals), rows[0].shape[1]))
            row[:, 6 * i + 3 * k : 6 * i + 3 * k + 3] = normals @ turn / (most * depth)
            rows.append(row)
    return np.vstack(rows)


def padded(vector: np.ndarray, size: int) -> np.ndarray:
    return np.concatenate([vector, np.zeros(size - len(vector))])


@pytest.mark.parametrize("space", SPACES)
def test_accelerations_of_random_postures(space: str) -> None:
    """To 1e-7 relative, with gravity, other accelerations zero, moments balanced."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 6)
    unknown = 0
    for joints in drawn:
        after = copose.evaluate(parse(cell), joints).after
        weight = truth.at_rest(joints)[-1]
        for record in after.accelerations:
            u = np.array(record.direction)
            force = padded(truth.M_o @ u, len(weight))
            expected = farthest_of_torques(truth, joints, 0 * u, u, weight, force)
            assert (record.value is None) == (expected is None)
            unknown += expected is None
            if expected is not None:
                assert record.value == pytest.approx(expected, rel=1e-7, abs=1e-7)
    assert unknown < 3 * len(drawn)


@pytest.mark.parametrize("space", SPACES)
def test_payload_is_held_with_every_joint_at_rest(space: str) -> None:
    """To 1e-7 of a program over contact wrenches; elbows that fall would hold more."""
    cell, thrown = cell_of(space, objective={"kind": "payload"}), []
    truth, drawn = postures(cell, 5)
    drawn += postures(cell, 5, seed=1)[1]
    for joints, measured in zip(drawn, measurements(cell, drawn), strict=True):
        payload = measured.posture.payload
        assert payload == measured.value
        assert payload == pytest.approx(heaviest_of_wrenches(truth, joints), rel=1e-7)
        weight = truth.at_rest(joints)[-1]
        nothing = np.zeros(len(truth.rows))
        per_kg = weight / cell["object"]["mass"]
        thrown.append(farthest_of_torques(truth, joints, nothing, nothing, 0 * weight, per_kg))
    assert max(np.array(thrown) / payload) > 1.001


def test_payload_of_the_shipped_problem() -> None:
    """With grips, in random postures."""
    cell = tables("panda-payload")
    truth, drawn = postures(cell, 4, seed=2)
    bound = 0
    for joints, measured in zip(drawn, measurements(cell, drawn), strict=True):
        expected = heaviest_of_wrenches(truth, joints)
        assert measured.value == pytest.approx(expected, rel=1e-7)
        h = np.concatenate([r.wrench for r in measured.posture.wrenches["payload"].values()])
        bound += np.any(bearing(truth) @ h > 1 - 1e-9)
    assert bound


@pytest.mark.parametrize("space", SPACES)
def test_payload_while_accelerating(space: str) -> None:
    """With q̈ = J⁺Wᵀa, which is reported."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 3)
    u = np.zeros(len(truth.rows))
    u[1] = 1.0
    cell["objective"] = {"kind": "payload", "acceleration": 1.5, "direction": u.tolist()}
    for joints, measured in zip(drawn, measurements(cell, drawn), strict=True):
        expected = heaviest_of_wrenches(truth, joints, 1.5 * u)
        assert measured.value == pytest.approx(expected, rel=1e-7)
        assert measured.posture.payload == measured.value
        _, J, _, W, _, _ = truth.at_rest(joints)
        moved = np.concatenate([*measured.posture.joint_accelerations["payload"].values()])
        assert np.allclose(moved, np.linalg.pinv(J) @ W.T @ (1.5 * u), atol=1e-9)


@pytest.mark.parametrize("space", SPACES)
def test_static_shares(space: str) -> None:
    """The largest share at its least, over contact wrenches alone."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 5)
    T = truth.torque_limits()
    for joints in drawn:
        _, J, g, _, X, weight = truth.at_rest(joints)
        rows = np.vstack([J.T, -J.T]) / np.tile(T, 2)[:, None]
        A = np.column_stack([-np.ones(2 * len(T)), rows])
        cost = np.zeros(A.shape[1])
        cost[0] = 1.0
        answer = linprog(
            cost, A, np.concatenate([-g / T, g / T]), np.column_stack([0 * weight, X]), weight,
            (None, None), options=EXACT,
        )  # fmt: skip
        after = copose.evaluate(parse(cell), joints).after
        shares = np.concatenate([after.static_torque[name] for name in joints])
        assert shares.max() == pytest.approx(answer.x[0], rel=1e-7)
        # And the wrenches that are reported hold the object with these very torques.
        h = np.concatenate([after.wrenches["hold"][name].wrench for name in joints])
        assert np.allclose(X @ h, weight, atol=1e-8)
        assert np.allclose(np.abs(g + J.T @ h) / T, shares, atol=1e-9)


@pytest.mark.parametrize("space", ["spatial-linear", "planar-linear"])
def test_the_held_object_does_not_spin(space: str) -> None:
    """In the linear spaces Σ r × f = 0 for every extreme, and without that more would be said."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 4)
    gains = []
    for joints in drawn:
        after = copose.evaluate(parse(cell), joints).after
        M, J, g, W, X, weight = truth.at_rest(joints)
        m = len(truth.rows)
        for name, by_arm in after.wrenches.items():
            f = np.concatenate([by_arm[arm].wrench for arm in joints])
            assert np.abs((X @ f)[m:]).max() < 1e-7 * max(1.0, np.abs(f).max()), name
            internal = np.concatenate([by_arm[arm].internal for arm in joints])
            assert np.abs(W @ internal).max() < 1e-7 * max(1.0, np.abs(f).max()), name
        back = J @ np.linalg.inv(M)
        inertia = np.linalg.inv(back @ J.T)
        T = truth.torque_limits()
        free = linprog(
            [*np.zeros(len(T)), -1.0],
            A_eq=np.column_stack([W @ inertia @ back, -weight[:m] / cell["object"]["mass"]]),
            b_eq=W @ inertia @ back @ g, bounds=[*((-x, x) for x in T), (None, None)],
        )  # fmt: skip
        gains.append(free.x[-1] / after.payload)
    assert min(gains) > 1 - 1e-9 and max(gains) > 1.01


def test_two_balls_beside_the_centre_of_mass_hold_nothing() -> None:
    """No force at them turns about the line through them: no hold, no mass, and no answer."""
    cell = cell_of("spatial-linear", objective={"kind": "payload"})
    for arm in cell["arms"]:
        arm["grasp"]["position"][1] = 0.05
    _, drawn = postures(cell, 2)
    for joints in drawn:
        solution = copose.evaluate(parse(cell), joints)
        assert solution.after.static_torque is None
        assert solution.after.payload == pytest.approx(0.0, abs=1e-9)
        assert any("no contact wrenches" in note for note in solution.notes)
    planner = copose.Planner(parse(cell))
    many = {name: np.array([joints[name] for joints in drawn]) for name in drawn[0]}
    assert np.isnan(planner.measure(many).objective).all()
    assert planner.solve().status == "infeasible"


@pytest.mark.parametrize("space", SPACES)
def test_many_postures_at_once_are_worth_what_each_is(space: str) -> None:
    """The batch of interior-point steps against HiGHS."""
    m = {"spatial": 6, "planar-linear": 2}.get(space, 3)
    up = [0.0] * m
    up[min(m - 1, 2) if space.startswith("spatial") else 1] = 1.0
    cell = cell_of(space, objective={"kind": "acceleration", "direction": up})
    ready = Cell.of(parse(cell))
    machinery = PostureModel(ready)
    setting = machinery.setting(ready)
    samples = [closed_postures(ready, i, 256)[:40] for i in range(2)]
    count = min(map(len, samples))
    q = np.hstack([sample[:count] for sample in samples])
    many = machinery.objectives(setting, q)
    allowance = TorqueLimitReport(ready, machinery.objective, machinery.capacity)
    for row, value in zip(q, many, strict=True):
        exact = allowance.asked(ready, ready.system.split(row)).value
        if exact is None:
            assert np.isnan(value)
        else:
            assert value == pytest.approx(exact, rel=1e-7, abs=1e-7)
    hold = setting.holding.hold
    dynamics = machinery.capacity.dynamics(setting.holding, machinery.split(q))
    shares = dynamics.shares(hold)
    for k in range(0, count, 7):
        assert shares[k] == pytest.approx(dynamics.hold(hold, k).value, rel=1e-7)


LIMITS = {
    "placeholders": lambda n: ([1e6] * n, [1e6] * n),
    "small": lambda n: ([1e-3] * n, [2e-3] * n),
    "one strong arm": lambda n: ([1e6] * n, [5.0] * n),
    "weak wrists": lambda n: ([100.0] * (n - 1) + [1e-3],) * 2,
}


@pytest.mark.parametrize(
    ("space", "name"),
    [
        ("spatial", "one strong arm"),
        ("spatial-linear", "placeholders"),
        *((space, name) for space in ("planar", "planar-linear") for name in LIMITS),
    ],
)
def test_limits_of_any_size(space: str, name: str) -> None:
    """Accelerations by shares of the limits, one posture at a time and many at once."""
    m = {"spatial": 6, "planar-linear": 2}.get(space, 3)
    directions = np.random.default_rng(0).normal(size=(3, m)).tolist()
    cell = cell_of(space, objective={"kind": "acceleration", "directions": directions})
    if name == "small":
        cell["world"] = {"gravity": [0.0] * (2 if space.startswith("planar") else 3)}
    size = 7 if space.startswith("spatial") else 4
    for arm, limits in zip(cell["arms"], LIMITS[name](size), strict=True):
        arm["torque_limits"] = limits
    truth, drawn = postures(cell, 3)
    told = []
    for joints, measured in zip(drawn, measurements(cell, drawn), strict=True):
        told.append(measured.value)
        weight = truth.at_rest(joints)[-1]
        for record in measured.posture.accelerations:
            u = np.array(record.direction)
            force = padded(truth.M_o @ u, len(weight))
            expected = farthest_of_torques(truth, joints, 0 * u, u, weight, force)
            assert record.value == pytest.approx(expected, rel=1e-7)
    ready = Cell.of(parse(cell))
    machinery = PostureModel(ready)
    many = np.array([np.concatenate(ready.given(joints)) for joints in drawn])
    assert machinery.objectives(machinery.setting(ready), many) == pytest.approx(told, rel=1e-6)


def equations(truth: Truth, joints: dict, solution: copose.Solution, name: str) -> np.ndarray:
    """a_o of an extreme, from its joint accelerations, that every contact must agree on."""
    _, J, _, W, _, _ = truth.at_rest(joints)
    by_arm = solution.after.joint_accelerations[name]
    moved = np.concatenate([by_arm[arm] for arm in joints])
    a, *_ = np.linalg.lstsq(W.T, J @ moved, rcond=None)
    assert np.allclose(W.T @ a, J @ moved, atol=1e-8 * np.abs(moved).max())
    return a


@pytest.mark.parametrize("space", SPACES)
def test_joint_accelerations_stand_beside_every_extreme(space: str) -> None:
    """They move the object so, and with their wrenches they take torques within the limits."""
    cell = cell_of(space)
    truth, drawn = postures(cell, 1)
    T, names = truth.torque_limits(), truth_axes(cell)
    for joints in drawn:
        solution = copose.evaluate(parse(cell), joints)
        after = solution.after
        M, J, g, _, _, _ = truth.at_rest(joints)
        values = [record for record in after.accelerations if record.value is not None]
        for name, record in zip(names, values, strict=True):
            a = equations(truth, joints, solution, name)
            assert np.allclose(a, record.value * np.array(record.direction), rtol=1e-7, atol=1e-6)
            h = np.concatenate([after.wrenches[name][arm].wrench for arm in joints])
            by_arm = after.joint_accelerations[name]
            moved = np.concatenate([by_arm[arm] for arm in joints])
            shares = np.abs((M @ moved + g + J.T @ h) / T)
            stated = np.concatenate([after.torque_shares[name][arm] for arm in joints])
            assert np.allclose(stated, shares, atol=1e-7)
            assert stated.max() == pytest.approx(1, abs=1e-8)
        for kind, exact in after.exact_sets.items():
            if exact.residual_radius:
                a = equations(truth, joints, solution, f"residual radius, {kind}")
                assert np.linalg.norm(a) == pytest.approx(exact.residual_radius, rel=1e-7)
        assert "payload" not in after.joint_accelerations


def truth_axes(cell: dict) -> list[str]:
    coordinates = parse(cell).space.coordinates
    return [f"acceleration {sign}{name}" for name in coordinates for sign in "+−"]


def test_what_joints_and_contacts_would_bear_is_told() -> None:
    """By joint and by arm; with grips contacts bear no more than they say."""
    cell = cell_of("spatial")
    _, (joints,) = postures(cell, 1)
    solution = copose.evaluate(parse(cell), joints)
    ((fast,), (loose,)) = (
        [note for note in solution.notes if word in note]
        for word in ("joint accelerations reach", "unbreakable")
    )
    largest = max(
        (abs(x), f"{arm}/{joint}")
        for by_arm in solution.after.joint_accelerations.values()
        for arm, part in by_arm.items()
        for joint, x in zip(solution.joint_names[arm], part, strict=True)
    )
    assert f"reach {largest[0]:,.0f} rad/s² ({largest[1]}" in fast and largest[0] > 100
    for rows, unit in ((slice(3), "N"), (slice(3, 6), "N·m")):
        every = [r.wrench[rows] for each in solution.after.wrenches.values() for r in each.values()]
        assert f"{max(map(np.linalg.norm, every)):,.4g} {unit} (" in loose
    for arm in cell["arms"]:
        arm["grip"] = {"force": 100.0}
    assert "unbreakable" not in " ".join(copose.evaluate(parse(cell), joints).notes)


@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(1, 20))
@example(13010, 6, 6)
@settings(max_examples=60, deadline=None)
def test_small_linear_programs(seed: int, p: int, more: int) -> None:
    """Batched programs against HiGHS: feasible, infeasible and unbounded ones."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(8, p + more, p)) * np.exp(rng.normal(size=p))
    b = rng.normal(size=(8, p + more)) + 0.7
    x, _ = maximise_first(A, b)
    cost = np.zeros(p)
    cost[0] = -1.0
    for k in range(8):
        answer = linprog(cost, A[k], b[k], bounds=(None, None), options=EXACT)
        if answer.success and abs(answer.x[0]) < 1e4:
            assert x[k, 0] == pytest.approx(answer.x[0], rel=1e-6, abs=1e-7)
        elif not answer.success:
            assert np.isnan(x[k, 0]) or abs(x[k, 0]) > 1e4


class TestContactWrenches:
    """Grips and internal force are bounds on norms, from inside, by many half-spaces."""

    @pytest.mark.parametrize("dimension", [1, 2, 3])
    def test_the_polyhedron_is_inside_the_ball(self, dimension: int) -> None:
        normals, depth = inner_polyhedron(dimension)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1)
        assert dimension < 3 or len(normals) >= 26
        rng = np.random.default_rng(0)
        farthest = 0.0
        for direction in rng.normal(size=(60, dimension)):
            answer = linprog(-direction, normals, np.full(len(normals), depth), bounds=(None, None))
            farthest = max(farthest, np.linalg.norm(answer.x))
            assert np.linalg.norm(answer.x) <= 1 + 1e-9
        assert farthest > 1 - 1e-9 and depth > 0.95

    @pytest.mark.few(3)
    @pytest.mark.parametrize("space", SPACES)
    def test_bounds_are_kept_and_cost_something(self, space: str) -> None:
        cell = cell_of(space)
        _, drawn = postures(cell, 4)
        loose = [copose.evaluate(parse(cell), joints).after for joints in drawn]
        rigid = space in ("spatial", "planar")
        size = {name: i for i, name in enumerate(drawn[0])}
        linear = 2 if space.startswith("planar") else 3
        bounded = cell_of(space, constraints={"internal_force": 15.0})
        for arm in bounded["arms"]:
            arm["grip"] = {"force": 60.0} | ({"moment": 4.0} if rigid else {})
        gained = []
        for joints, before in zip(drawn, loose, strict=True):
            after = copose.evaluate(parse(bounded), joints).after
            for by_arm in after.wrenches.values():
                for name in size:
                    h, inner = by_arm[name].wrench, by_arm[name].internal
                    assert np.linalg.norm(h[:linear]) <= 60 + 1e-6
                    assert np.linalg.norm(h[linear:]) <= 4 + 1e-6
                    assert np.linalg.norm(inner[:linear]) <= 15 + 1e-6
            if after.payload is not None:
                assert after.payload <= before.payload + 1e-7
                gained.append(before.payload - after.payload)
        assert max(gained) > 0.01

    def test_the_internal_part_is_what_the_nonsqueezing_inverse_leaves(self) -> None:
        cell = cell_of("spatial")
        truth, (joints,) = postures(cell, 1)
        after = copose.evaluate(parse(cell), joints).after
        _, _, _, W, _, _ = truth.at_rest(joints)
        shares = [np.linalg.inv(truth.W(table)) for table in cell["arms"]]
        inverse = np.vstack(shares) / 2
        for by_arm in after.wrenches.values():
            h = np.concatenate([by_arm[arm].wrench for arm in joints])
            internal = np.concatenate([by_arm[arm].internal for arm in joints])
            assert np.allclose(internal, h - inverse @ W @ h, atol=1e-9)
