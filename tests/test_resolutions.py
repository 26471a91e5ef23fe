"""Both ellipsoids against the full constrained dynamics, exact arithmetic and sampled torques."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from cells import planar, two_pandas
from copose.capability import RESOLUTIONS, Ellipsoid, log_ball_volume, torque_map
from copose.cell.cell import Cell
from copose.measurement.meter import Meter
from copose.mechanics import System, object_parameters
from copose.problem import parse
from copose.robots import load_arms
from reference import Problem as Truth
from test_capability import conditioned

SPACES = ["spatial", "spatial-linear", "planar", "planar-linear"]
SIZES = {"spatial": 6, "spatial-linear": 3, "planar": 3, "planar-linear": 2}


def cell_of(space: str, **ellipsoid: object) -> dict:
    cell = two_pandas(space) if space.startswith("spatial") else planar(2, 4, space)
    for arm in cell["arms"]:
        if "links" in arm:
            arm["torque_limits"] = [40.0, 30.0, 20.0, 10.0]
    cell["ellipsoid"] = ellipsoid
    return cell


def postures(cell: dict, count: int, seed: int = 0):
    """Joint positions by arm, open or closed: the ellipsoids do not ask."""
    ready = Cell.of(parse(cell))
    rng = np.random.default_rng(seed)
    truth = Truth(cell, {arm.name: list(arm.joint_names) for arm in ready.arms})
    for _ in range(count):
        q = [rng.uniform(np.fmax(a.lower, -1.5), np.fmin(a.upper, 1.5)) for a in ready.arms]
        yield ready, truth, q, dict(zip(truth.arms, q, strict=True))


@pytest.mark.few(12)
@pytest.mark.parametrize("scaling", ["unit", "limits"])
@pytest.mark.parametrize("distribution", ["moore-penrose", "nonsqueezing"])
@pytest.mark.parametrize("resolution", ["pseudoinverse", "torque-optimal"])
@pytest.mark.parametrize("space", SPACES)
def test_gram_and_center_by_the_equations_of_motion(
    space: str, resolution: str, distribution: str, scaling: str
) -> None:
    cell = cell_of(
        space, resolution=resolution, load_distribution=distribution, torque_scaling=scaling,
        gravity=True,
    )  # fmt: skip
    rng = np.random.default_rng(4)
    cell["object"]["velocity"] = rng.normal(size=SIZES[space]).tolist()
    if space == "spatial":
        # Of a cube, turning would take no gyroscopic moment.
        cell["object"].update(inertia=[0.02, 0.05, 0.04], rpy=[0.3, -0.2, 0.5])
    cell["world"] = {"gravity": [0.3, -9.0] if space.startswith("planar") else [0.4, -0.2, -9.5]}
    for ready, truth, q, joints in postures(cell, 5):
        measured = Meter(ready).measure(ready, q)
        factor, center = truth.ellipsoid(joints)
        E = measured.ellipsoid
        assert E is not None
        gram = factor.T @ factor
        assert np.allclose(E.gram, gram, rtol=0, atol=1e-8 * np.abs(gram).max())
        assert np.allclose(E.radii, 1 / np.linalg.svd(factor, compute_uv=False)[::-1], rtol=1e-7)
        assert np.allclose(E.center, center, rtol=0, atol=1e-8 * max(1, np.abs(center).max()))


@pytest.mark.parametrize("scaling", ["unit", "limits"])
@pytest.mark.parametrize("space", SPACES)
def test_torques_of_the_ball_through_the_constrained_dynamics(space: str, scaling: str) -> None:
    """They land inside the torque-optimal ellipsoid, those along T²BᵀG u on it; it holds E."""
    cell = cell_of(space, resolution="torque-optimal", torque_scaling=scaling)
    rng = np.random.default_rng(1)
    for ready, truth, q, joints in postures(cell, 4):
        optimal = Meter(ready).measure(ready, q).ellipsoid
        paper = Ellipsoid.from_factor(truth.at(joints).factor / truth.limits()[:, None])
        assert optimal is not None
        B, _ = truth.constrained_dynamics(joints)
        T = truth.limits()
        torques = rng.normal(size=(2000, len(T)))
        torques = T * torques / np.linalg.norm(torques, axis=1, keepdims=True)
        assert optimal.contains(torques @ B.T, 1e-9).all()
        for a in optimal.boundary(rng.normal(size=(50, len(B)))):
            torque = T**2 * (B.T @ (optimal.gram @ a))
            assert abs(np.linalg.norm(torque / T) - 1) < 1e-8
            assert np.allclose(B @ torque, a, atol=1e-9 * np.abs(a).max() + 1e-12)
        assert optimal.contains(paper.boundary(rng.normal(size=(500, len(B)))), 1e-9).all()


@pytest.mark.parametrize("space", SPACES)
def test_the_forward_dynamics_undo_the_papers_torques(space: str) -> None:
    """B A_o = I to 1e-14·cond."""
    cell = cell_of(space)
    for _, truth, _, joints in postures(cell, 5):
        B, _ = truth.constrained_dynamics(joints)
        A_o = truth.at(joints).factor
        system = Cell.of(parse(cell)).system
        ours = ca.Function(
            "A_o",
            [system.q, system.object.parameters],
            [ca.vertcat(*(torque_map(system, i) for i in range(2)))],
        )
        ready = Cell.of(parse(cell))
        A = np.array(ours(np.concatenate(list(joints.values())), ready.parameters))
        assert np.allclose(A, A_o, rtol=0, atol=1e-9 * np.abs(A_o).max())
        condition = np.linalg.cond(A) * np.linalg.cond(B)
        size = np.linalg.norm(B) * np.linalg.norm(A)
        assert np.abs(B @ A - np.eye(len(B))).max() <= 1e-14 * max(condition, size)


@pytest.mark.parametrize("scaling", ["unit", "limits"])
@pytest.mark.parametrize("space", SPACES)
def test_gram_is_the_least_torque_over_null_motions_and_internal_forces(
    space: str, scaling: str
) -> None:
    cell = cell_of(space, resolution="torque-optimal", torque_scaling=scaling)
    rng = np.random.default_rng(2)
    import scipy.linalg

    for ready, truth, q, joints in postures(cell, 3):
        E = Meter(ready).measure(ready, q).ellipsoid
        assert E is not None
        T = truth.limits()
        parts = [truth.arms[name].at(np.array(joints[name])) for name in joints]
        J = scipy.linalg.block_diag(*(part[1][truth.rows] for part in parts))
        M = scipy.linalg.block_diag(*(part[2] for part in parts))
        W = np.hstack([truth.W(table) for table in cell["arms"]])
        null, internal = scipy.linalg.null_space(J), scipy.linalg.null_space(W)
        for _ in range(5):
            a = rng.normal(size=len(W))
            torque = M @ np.linalg.pinv(J) @ W.T @ a + J.T @ np.linalg.pinv(W) @ truth.M_o @ a
            free = np.hstack([M @ null, J.T @ internal]) / T[:, None]
            best = np.linalg.lstsq(free, torque / T, rcond=None)[0]
            least = np.sum((torque / T - free @ best) ** 2)
            assert abs(a @ E.gram @ a - least) < 1e-8 * least


@pytest.mark.parametrize("condition", [1e1, 1e3, 1e5])
@pytest.mark.parametrize("space", SPACES)
def test_torque_optimal_is_exact_to_1e6(space: str, condition: float) -> None:
    problem = parse(cell_of(space))
    system = System.of(problem.space, load_arms(problem))
    m = system.space.m
    symbols = [
        (ca.SX.sym("J", m, arm.arm.n), ca.SX.sym("M", arm.arm.n, arm.arm.n)) for arm in system.arms
    ]
    arms = zip(system.arms, symbols, strict=True)
    bare = replace(
        system, arms=tuple(replace(arm, J_root=arm.R_world_root.T @ J, M=M) for arm, (J, M) in arms)
    )
    rng = np.random.default_rng(int(condition))
    scales = [rng.uniform(5, 90, arm.arm.n) for arm in system.arms]
    factor = ca.Function(
        "F",
        [s for pair in symbols for s in pair] + [system.object.parameters],
        [RESOLUTIONS["torque-optimal"].factor(bare, scales), system.object.M_o, *system.object.W],
    )
    thing = problem.object
    parameters = object_parameters(thing.pose, thing.mass, thing.inertia or 0.0)
    mp.mp.dps = 60
    for _ in range(3):
        numbers = []
        for arm in system.arms:
            root = rng.normal(size=(arm.arm.n, arm.arm.n))
            numbers += [
                conditioned(rng, m, arm.arm.n, condition),
                root @ root.T + np.eye(arm.arm.n),
            ]
        F, M_o, *W = (np.array(x) for x in factor(*numbers, parameters))
        S, R = mp.matrix(M_o), mp.zeros(m, m)
        for i, scale in enumerate(scales):
            J, M, W_i = (mp.matrix(x) for x in (*numbers[2 * i : 2 * i + 2], W[i]))
            Y = J * M**-1
            L = (Y * J.T) ** -1
            S += W_i * L * W_i.T
            root = W_i * L * Y * mp.diag(scale.tolist())
            R += root * root.T
        values = sorted(mp.eigsy(S * R**-1 * S, eigvals_only=True))
        E = Ellipsoid.from_factor(F)
        for radius, value in zip(E.radii, values, strict=True):
            assert abs(mp.mpf(radius) * mp.sqrt(value) - 1) < 1e-6
        exact = -sum(mp.log(v) for v in values) / 2 + log_ball_volume(m)
        assert abs(E.log_volume - exact) < 1e-6


def test_one_arm_alone_is_yoshikawas_redundant_or_not() -> None:
    """K = 1 and M_o = 0: G = (J M⁻² Jᵀ)⁻¹ at the tip, redundant arms included."""
    for links, space in itertools.product((3, 5), ("planar", "planar-linear")):
        cell = planar(1, links, space)
        cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
        problem = parse(cell)
        system = System.of(problem.space, load_arms(problem))
        arm = system.arms[0]
        resolution = RESOLUTIONS["torque-optimal"]
        numbers = ca.Function(
            "n",
            [arm.q, system.object.parameters],
            [
                resolution.system_gram(system, [np.ones(links)]),
                resolution.own_factor(arm, np.ones(links)),
                arm.J,
                arm.M,
            ],
        )
        parameters = object_parameters(problem.object.pose, 0.0, 0.0)
        rng = np.random.default_rng(0)
        for _ in range(10):
            G, own, J, M = (np.array(x) for x in numbers(rng.uniform(-2, 2, links), parameters))
            inverse = np.linalg.inv(M)
            expected = np.linalg.inv(J @ inverse @ inverse @ J.T)
            for gram in (G, own.T @ own):
                assert np.allclose(gram, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("resolution", ["pseudoinverse", "torque-optimal"])
def test_axes_keep_the_slice_of_the_centred_ellipsoid(resolution: str) -> None:
    whole = cell_of("spatial", resolution=resolution, gravity=True)
    part = cell_of("spatial", resolution=resolution, gravity=True)
    part["objective"] = {"kind": "volume", "axes": ["z", "x"]}
    for (ready, _, q, _), (sliced, truth, _, joints) in zip(
        postures(whole, 3), postures(part, 3), strict=True
    ):
        E, slice_ = (
            Meter(ready).measure(ready, q).ellipsoid,
            Meter(sliced).measure(sliced, q).ellipsoid,
        )
        assert E is not None and slice_ is not None
        assert np.allclose(slice_.gram, E.gram[np.ix_([2, 0], [2, 0])], rtol=1e-10)
        assert np.allclose(slice_.center, E.center[[2, 0]])
        factor, center = truth.ellipsoid(joints)
        assert np.allclose(slice_.gram, factor.T @ factor, rtol=1e-7)
        assert np.allclose(slice_.center, center, atol=1e-8 * np.abs(center).max())


def test_both_volumes_are_reported_whichever_is_optimised() -> None:
    volumes = []
    for resolution in ("pseudoinverse", "torque-optimal"):
        cell = cell_of("spatial", resolution=resolution)
        for ready, _, q, _ in postures(cell, 1):
            measured = Meter(ready).measure(ready, q)
            assert measured.ellipsoid is not None
            volumes.append(measured.posture.log_volumes)
            assert volumes[-1][resolution] == measured.ellipsoid.log_volume
    for name in volumes[0]:
        assert math.isclose(volumes[0][name], volumes[1][name], rel_tol=1e-12)
    assert volumes[0]["torque-optimal"] > volumes[0]["pseudoinverse"]
