"""A_o and its ellipsoids against exact arithmetic, closed forms and sampled torques."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cells import planar, two_pandas
from copose.capability import RESOLUTIONS, Ellipsoid, log_ball_volume, torque_map
from copose.capability.torque_maps import own_torque_map
from copose.cell.cell import Cell
from copose.measurement.meter import Meter
from copose.mechanics import System, object_parameters
from copose.problem import parse
from copose.robots import load_arms

SPACES = ["spatial", "spatial-linear", "planar", "planar-linear"]


def cell_of(space: str, arms: int = 2) -> dict:
    return two_pandas(space) if space.startswith("spatial") else planar(arms, 4, space)


def conditioned(rng: np.random.Generator, m: int, n: int, condition: float) -> np.ndarray:
    U, _ = np.linalg.qr(rng.normal(size=(m, m)))
    V, _ = np.linalg.qr(rng.normal(size=(n, n)))
    return U @ np.diag(np.geomspace(1, 1 / condition, m)) @ V[:m]


@pytest.mark.parametrize("condition", [1e1, 1e3, 1e5])
@pytest.mark.parametrize("space", SPACES)
def test_gram_radii_and_volume_are_exact_to_1e8(space: str, condition: float) -> None:
    problem = parse(cell_of(space))
    system = System.of(problem.space, load_arms(problem))
    m = system.space.m
    symbols = [
        (ca.SX.sym("J", m, arm.arm.n), ca.SX.sym("M", arm.arm.n, arm.arm.n)) for arm in system.arms
    ]
    bare = replace(
        system,
        arms=tuple(
            replace(arm, J_root=arm.R_world_root.T @ J, M=M)
            for arm, (J, M) in zip(system.arms, symbols, strict=True)
        ),
    )
    A_of = ca.Function(
        "A",
        [s for pair in symbols for s in pair] + [system.object.parameters],
        [ca.vertcat(*(torque_map(bare, i) for i in range(len(bare.arms)))), *system.object.W],
    )
    rng = np.random.default_rng(int(condition))
    thing = problem.object
    parameters = object_parameters(thing.pose, thing.mass, thing.inertia or 0.0)
    for _ in range(3):
        numbers = []
        for arm in system.arms:
            root = rng.normal(size=(arm.arm.n, arm.arm.n))
            numbers += [
                conditioned(rng, m, arm.arm.n, condition),
                root @ root.T + np.eye(arm.arm.n),
            ]
        A, *W = (np.array(x) for x in A_of(*numbers, parameters))
        exact = _exact(numbers, W, problem, m)
        G = A.T @ A
        G_exact = exact.T * exact
        largest = max(abs(x) for x in G_exact)
        assert max(abs(mp.mpf(G[i, j]) - G_exact[i, j]) for i in range(m) for j in range(m)) <= (
            1e-8 * largest
        )
        ellipsoid = Ellipsoid.from_factor(A)
        values = sorted(mp.eigsy(G_exact, eigvals_only=True))
        for radius, value in zip(ellipsoid.radii, values, strict=True):
            assert abs(mp.mpf(radius) * mp.sqrt(value) - 1) < 1e-8
        log_volume = -sum(mp.log(v) for v in values) / 2 + log_ball_volume(m)
        assert abs(ellipsoid.log_volume - log_volume) < 1e-8


def _exact(numbers, W, problem, m):
    """A_o in 60 digits from the same J, M and W."""
    mp.mp.dps = 60
    R = problem.object.pose.rotation
    inertia = np.array(problem.object.inertia if problem.object.inertia is not None else 0.0)
    inertia = np.eye(3) * inertia if inertia.ndim == 0 else inertia
    full = np.zeros((6, 6))
    full[:3, :3], full[3:, 3:] = problem.object.mass * np.eye(3), R @ inertia @ R.T
    rows = list(problem.space.rows)
    M_o = mp.matrix(full[np.ix_(rows, rows)])
    stacked = mp.matrix(np.hstack(W))
    W_pinv = stacked.T * (stacked * stacked.T) ** -1
    blocks = []
    for i in range(len(W)):
        J, M = mp.matrix(numbers[2 * i]), mp.matrix(numbers[2 * i + 1])
        pinv = J.T * (J * J.T) ** -1
        block = M * pinv * mp.matrix(W[i]).T + J.T * W_pinv[m * i : m * i + m, :] * M_o
        blocks.append(block)
    rows_total = sum(block.rows for block in blocks)
    A = mp.matrix(rows_total, m)
    row = 0
    for block in blocks:
        A[row : row + block.rows, :] = block
        row += block.rows
    return A


@pytest.mark.parametrize("arms", [2, 3])
@pytest.mark.parametrize("space", SPACES)
def test_massless_object_lies_between_the_intersection_and_its_root_k(
    space: str, arms: int
) -> None:
    """E ⊂ ∩E_i ⊂ √K·E at the centre of mass, E_i with Gram W_i G_i W_iᵀ."""
    cell = cell_of(space, arms)
    problem = parse(cell)
    system = System.of(problem.space, load_arms(problem))
    K, m = len(system.arms), system.space.m
    maps = ca.Function(
        "maps",
        [system.q, system.object.parameters],
        [
            ca.vertcat(*(torque_map(system, i) for i in range(K))),
            *(own_torque_map(arm) for arm in system.arms),
            *system.object.W,
        ],
    )
    parameters = object_parameters(problem.object.pose, 0.0, 0.0)
    rng = np.random.default_rng(5)
    for _ in range(20):
        A, *rest = (
            np.array(x) for x in maps(rng.uniform(-1.5, 1.5, system.q.shape[0]), parameters)
        )
        own, W = rest[:K], rest[K:]
        E = Ellipsoid.from_factor(A)
        each = [Ellipsoid.from_factor(B @ W_i.T) for B, W_i in zip(own, W, strict=True)]
        directions = rng.normal(size=(200, m))
        on_E = E.boundary(directions)
        for arm in each:
            assert arm.contains(on_E, 1e-9).all()
        u = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        nearest = np.min([[arm.radius(v) for v in u] for arm in each], axis=0)
        assert E.contains(u * nearest[:, None] / math.sqrt(K), 1e-9).all()


def test_single_arm_without_object_is_yoshikawas_ellipsoid() -> None:
    """K = 1, M_o = 0, square J, object at the tip: G = (J M⁻² Jᵀ)⁻¹."""
    cell = planar(1, 3, "planar")
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    problem = parse(cell)
    system = System.of(problem.space, load_arms(problem))
    arm = system.arms[0]
    numbers = ca.Function(
        "n",
        [arm.q, system.object.parameters],
        [RESOLUTIONS["pseudoinverse"].system_gram(system, [np.ones(3)]), arm.J, arm.M],
    )
    parameters = object_parameters(problem.object.pose, 0.0, 0.0)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(-2, 2, 3)
        G, J, M = (np.array(x) for x in numbers(q, parameters))
        inverse = np.linalg.inv(M)
        expected = np.linalg.inv(J @ inverse @ inverse @ J.T)
        assert np.allclose(G, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("space", ["planar", "planar-linear"])
def test_single_arm_with_object_and_square_jacobian(space: str) -> None:
    """K = 1, square J, object at the tip: A_o = (M + JᵀM_oJ) J⁻¹."""
    cell = planar(1, 3 if space == "planar" else 2, space)
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    problem = parse(cell)
    system = System.of(problem.space, load_arms(problem))
    arm = system.arms[0]
    numbers = ca.Function(
        "n",
        [arm.q, system.object.parameters],
        [torque_map(system, 0), arm.J, arm.M, system.object.M_o],
    )
    parameters = object_parameters(problem.object.pose, 1.7, 0.04)
    rng = np.random.default_rng(0)
    for _ in range(20):
        A, J, M, M_o = (np.array(x) for x in numbers(rng.uniform(0.3, 2, arm.arm.n), parameters))
        expected = (M + J.T @ M_o @ J) @ np.linalg.inv(J)
        assert np.allclose(A, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_stretched_arm_has_volume_zero_and_says_so() -> None:
    cell = planar(1, 3)
    cell["arms"][0].update(base={"position": [0, 0]}, grasp={"position": [0.0, 0.0]})
    cell["object"]["position"] = [1.2, 0.0]
    ready = Cell.of(parse(cell))
    measured = Meter(ready).measure(ready, [np.zeros(3)])
    assert measured.ellipsoid is None
    assert measured.posture.ellipsoid.log_volume is None
    assert measured.posture.ellipsoid.gram is None
    assert "volume 0" in measured.notes[0] and "rank 1 of 2" in measured.notes[0]
    bent = Meter(ready).measure(ready, [np.array([0.0, 1e-7, 0.0])])
    assert bent.ellipsoid is not None


vectors = st.integers(2, 6).flatmap(
    lambda m: st.lists(
        st.lists(st.floats(-2, 2), min_size=m, max_size=m), min_size=m + 2, max_size=m + 2
    )
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(vectors, st.integers(0, 1000))
def test_ellipsoid_is_the_set_that_it_says(rows: list[list[float]], seed: int) -> None:
    A = np.vstack([np.array(rows), np.eye(len(rows[0])) * 0.1])
    m = A.shape[1]
    rng = np.random.default_rng(seed)
    center = rng.normal(size=m)
    E = Ellipsoid.from_factor(A, center)
    assert np.all(np.diff(E.radii) <= 0)
    surface = E.boundary(rng.normal(size=(300, m)))
    norms = np.linalg.norm((surface - center) @ A.T, axis=1)
    assert np.allclose(norms, 1, atol=1e-9)
    assert (
        E.contains(surface, 1e-9).all() and not E.contains(center + 1.01 * (surface - center)).any()
    )
    u = rng.normal(size=m)
    u /= np.linalg.norm(u)
    reached = (surface @ u).max()
    assert reached <= E.support(u) + 1e-9
    inverse = np.linalg.inv(A.T @ A)
    top = center + inverse @ u / math.sqrt(u @ inverse @ u)
    assert E.contains(top, 1e-9) and abs(top @ u - E.support(u)) < 1e-9 * max(1, abs(top @ u))
    assert abs(np.linalg.norm(A @ (E.radius(u) * u)) - 1) < 1e-9
    sign, log_det = np.linalg.slogdet(A.T @ A)
    assert sign == 1 and abs(E.log_volume - (log_ball_volume(m) - log_det / 2)) < 1e-8
    for radius, axis in zip(E.radii, E.axes, strict=True):
        assert abs(E.radius(axis) - radius) < 1e-9 * radius
    again = Ellipsoid.from_factor(np.linalg.cholesky(E.gram).T, center)
    assert np.allclose(again.radii, E.radii, rtol=1e-6)


def test_log_ball_volume_by_known_values() -> None:
    known = {1: 2.0, 2: math.pi, 3: 4 * math.pi / 3, 6: math.pi**3 / 6}
    for m, volume in known.items():
        assert abs(log_ball_volume(m) - math.log(volume)) < 1e-14


def test_a_slice_is_what_is_left_with_the_others_zero() -> None:
    rng = np.random.default_rng(2)
    E = Ellipsoid.from_factor(rng.normal(size=(9, 6)))
    part = E.sliced([0, 1, 2])
    on_part = part.boundary(rng.normal(size=(50, 3)))
    padded = np.hstack([on_part, np.zeros((50, 3))])
    assert np.allclose(np.einsum("ki,ij,kj->k", padded, E.gram, padded), 1, atol=1e-10)


@pytest.mark.parametrize(
    "factor", [np.ones((3, 2)), np.full((2, 2), np.nan), np.ones((1, 2)), np.zeros((2, 2))]
)
def test_what_is_no_ellipsoid_is_refused(factor: np.ndarray) -> None:
    with pytest.raises(ValueError, match="ellipsoid"):
        Ellipsoid.from_factor(factor)


def test_torques_of_the_unit_ball_are_what_an_acceleration_takes() -> None:
    """τ = M q̈ + Jᵀh with J q̈ = Wᵀa, h = W⁺M_o a, both least-norm: ‖τ‖ = 1 on the surface."""
    cell = two_pandas()
    ready = Cell.of(parse(cell))
    q = np.random.default_rng(0).uniform(-1, 1, 14)
    measured = Meter(ready).measure(ready, ready.system.split(q))
    assert measured.ellipsoid is not None
    from reference import Problem

    truth = Problem(cell, {arm.name: list(arm.joint_names) for arm in ready.arms})
    W = np.hstack([truth.W(table) for table in cell["arms"]])
    for a in measured.ellipsoid.boundary(np.random.default_rng(1).normal(size=(20, 6))):
        h = np.linalg.lstsq(W, truth.M_o @ a, rcond=None)[0]
        torques = []
        for i, table in enumerate(cell["arms"]):
            _, J, M, _ = truth.arms[table["name"]].at(q[7 * i : 7 * i + 7])
            acceleration = np.linalg.lstsq(J, W[:, 6 * i : 6 * i + 6].T @ a, rcond=None)[0]
            torques.append(M @ acceleration + J.T @ h[6 * i : 6 * i + 6])
        assert abs(np.linalg.norm(np.concatenate(torques)) - 1) < 1e-8
