"""Velocity and force ellipsoids against numpy on Pinocchio's Jacobians, and against samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

import copose
from copose.problem import parse
from test_torque_limits import SPACES, cell_of, postures

NAMES = [
    "closed-chain velocity",
    "averaged velocity",
    "external force",
    "external force, internal force optimal",
]


def grams(cell: dict, truth, joints: dict) -> dict[str, np.ndarray]:
    """G of each by its definition."""
    _, J, _, W, _, _ = truth.at_rest(joints)
    scaled = cell.get("ellipsoid", {}).get("torque_scaling") == "limits"
    T = truth.torque_limits() if scaled else np.ones(J.shape[1])
    W_pinv = np.linalg.pinv(W)
    if cell.get("ellipsoid", {}).get("load_distribution") == "nonsqueezing":
        shares = [np.linalg.inv(truth.W(table)) for table in cell["arms"]]
        W_pinv = np.vstack(shares) / len(shares)
    JJ, TT = J @ J.T, J @ np.diag(T**-2.0) @ J.T
    return {
        NAMES[0]: W @ np.linalg.inv(JJ) @ W.T,
        NAMES[1]: np.linalg.inv(W_pinv.T @ JJ @ W_pinv),
        NAMES[2]: W_pinv.T @ TT @ W_pinv,
        NAMES[3]: np.linalg.inv(W @ np.linalg.inv(TT) @ W.T),
    }


@pytest.mark.few(6)
@pytest.mark.parametrize("scaling", ["unit", "limits"])
@pytest.mark.parametrize("distribution", ["moore-penrose", "nonsqueezing"])
@pytest.mark.parametrize("space", SPACES)
def test_companions_of_random_postures(space: str, distribution: str, scaling: str) -> None:
    settings = {"load_distribution": distribution, "torque_scaling": scaling}
    cell = cell_of(space, ellipsoid=settings)
    truth, drawn = postures(cell, 3)
    for joints in drawn:
        after = copose.evaluate(parse(cell), joints).after
        for name, gram in grams(cell, truth, joints).items():
            found = np.array(after.companions[name].gram)
            size = np.sqrt(np.outer(np.diag(gram), np.diag(gram)))
            assert np.abs((found - gram) / size).max() < 1e-7, name
            along = after.companions[name].along
            assert np.allclose(along, np.diag(gram) ** -0.5, rtol=1e-7)
        _, J, _, W, _, _ = truth.at_rest(joints)
        T = truth.torque_limits() if scaling == "limits" else np.ones(J.shape[1])
        V = np.linalg.svd(W)[2][len(W) :].T
        expected = np.linalg.eigvalsh(V.T @ J @ np.diag(T**-2.0) @ J.T @ V)
        radii = np.array(after.companions["internal force"].radii)
        assert np.allclose(radii, expected**-0.5, rtol=1e-7)


@pytest.mark.parametrize("space", SPACES)
def test_joint_speeds_of_the_closed_chain_fill_the_velocity_ellipsoid(space: str) -> None:
    """Unit joint speeds that keep the grasp move the object within it, the least of them up to it.

    And external wrenches that torques of the unit ball hold are within the force ellipsoid with
    internal force optimal, which no other distribution leaves.
    """
    cell = cell_of(space)
    truth, (joints,) = postures(cell, 1)
    after = copose.evaluate(parse(cell), joints).after
    _, J, _, W, _, _ = truth.at_rest(joints)
    m = len(W)
    rng = np.random.default_rng(0)
    velocity = after.companions[NAMES[0]].value
    together = np.linalg.svd(np.hstack([J, -W.T]))[2][-(J.shape[1] + m - len(J)) :]
    for _ in range(300):
        both = rng.normal(size=len(together)) @ together
        both /= np.linalg.norm(both[:-m])
        assert velocity.contains(both[-m:], 1e-9)
    for _ in range(20):
        v = velocity.boundary(rng.normal(size=m))
        least = np.linalg.pinv(J) @ W.T @ v
        assert np.allclose(J @ least, W.T @ v) and np.linalg.norm(least) == pytest.approx(1)
    force = after.companions[NAMES[3]].value
    for _ in range(300):
        h = rng.normal(size=len(J))
        h /= np.linalg.norm(J.T @ h)
        assert force.contains(W @ h, 1e-9)
    shared = after.companions[NAMES[2]].value
    assert all(force.contains(shared.boundary(rng.normal(size=m)), 1e-9) for _ in range(100))


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("kind", "name"), [("velocity-volume", NAMES[0]), ("force-volume", NAMES[2])]
)
@pytest.mark.parametrize("axes", [None, ["x", "y"]])
@pytest.mark.parametrize("space", SPACES)
def test_their_volumes_as_objectives(space: str, axes: list | None, kind: str, name: str) -> None:
    """The value is the ellipsoid's log-volume, that of its slice where axes ask for one."""
    cell = cell_of(space, objective={"kind": kind} | ({"axes": axes} if axes else {}))
    truth, drawn = postures(cell, 2)
    for joints in drawn:
        solution = copose.evaluate(parse(cell), joints)
        gram = grams(cell, truth, joints)[name]
        gram = gram[:2, :2] if axes else gram
        a = len(gram)
        ball = a / 2 * math.log(math.pi) - math.lgamma(a / 2 + 1)
        expected = ball - 0.5 * np.linalg.slogdet(gram)[1]
        assert solution.objective.after == pytest.approx(expected, rel=1e-8, abs=1e-8)
    solution = copose.solve(parse(cell), effort="low")
    after = dict(solution.after.joints)
    gram = grams(cell, truth, after)[name]
    gram = gram[:2, :2] if axes else gram
    assert solution.objective.after == pytest.approx(
        ball - 0.5 * np.linalg.slogdet(gram)[1], rel=1e-8, abs=1e-8
    )
    measured = copose.Planner(parse(cell)).measure({k: [v] for k, v in after.items()})
    assert measured.objective[0] == pytest.approx(solution.objective.after, abs=1e-8)
