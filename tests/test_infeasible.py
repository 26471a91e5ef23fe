"""Exit 3 holds: a bound, or all that there is judged; what a search did not find is exit 4."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

import copose
import copose.posture.model
from cells import planar
from copose.cell.cell import Cell
from copose.constraints.posture_constraint import PostureConstraint
from copose.constraints.registry import constraints_of
from copose.motion.graph.dynamic_programming import Lattice, Moves
from copose.motion.graph.routes import RouteCost, RouteFinder
from copose.posture.model import PostureModel
from copose.posture.search import global_search
from copose.robots.reach_bounds import ReachBound
from copose.self_motion.misses.branch_and_bound import excluded
from copose.self_motion.sampling import ArmSample, ArmSampler
from path_problems import single_hinged


def bounded(cell: dict, limits: np.ndarray) -> tuple[bool, np.ndarray]:
    """Whether the arm is told to reach its grasp in no posture; and where it has to bring its tip,
    from its base.
    """
    cell["arms"][0]["position_limits"] = limits.tolist()
    ready = Cell.of(copose.parse(cell))
    machinery = PostureModel(ready)
    goal = machinery.setting(ready).placement.goals[0]
    told = excluded(
        ready.arms[0], machinery.arms[0], ready.lower[0], ready.upper[0], goal,
        rigid=ready.system.space.rigid,
    )  # fmt: skip
    return told, goal[:2]


@pytest.mark.parametrize("seed", range(6))
def test_what_is_out_of_reach_is_so_on_a_grid_and_what_is_in_reach_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = planar(1, 3)
    cell["arms"][0]["base"] = {"position": [0.0, 0.0]}
    cell["arms"][0]["grasp"] = {"position": [0.0, 0.0]}
    low = rng.uniform(-1.5, 0.0, 3)
    limits = np.column_stack([low, low + rng.uniform(0.3, 1.2, 3)])
    axes = [np.linspace(*ends, 25) for ends in limits]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    tips = 0.4 * np.exp(1j * np.cumsum(grid, axis=1)).sum(axis=1)
    # Half a step of every joint, by how far the tip then comes.
    grain = sum(
        lever * np.ptp(axis) / 48 for lever, axis in zip((1.2, 0.8, 0.4), axes, strict=True)
    )
    for number in range(6):
        tip = tips[rng.integers(len(tips))]
        if number % 2:
            tip = complex(*rng.uniform(-1.3, 1.3, 2))
        cell["object"]["position"] = [tip.real, tip.imag]
        told, goal = bounded(cell, limits)
        nearest = np.abs(tips - complex(*goal)).min()
        if number % 2 == 0 or nearest < 1e-9:
            assert not told
        elif nearest > 2 * grain:
            assert told
        elif told:
            assert nearest > 1e-9


def test_links_that_are_too_short_are_told_by_how_much() -> None:
    cell = planar(1, 5)
    cell["object"]["position"] = [5.0, 0.1]
    ready = Cell.of(copose.parse(cell))
    goal = PostureModel(ready).setting(ready).placement.goals[0]
    base = np.array(cell["arms"][0]["base"]["position"])
    gap = np.linalg.norm(np.array([4.85, 0.1]) - base) - 5 * 0.4
    bound = ReachBound.of(ready.arms[0], ready.lower[0], ready.upper[0])
    assert bound.missed(goal, rigid=False) == pytest.approx(gap, abs=1e-12)


def test_what_random_postures_do_not_close_is_not_called_infeasible(monkeypatch) -> None:
    def nothing(samplers: list[ArmSampler], rngs: list, *effort: int) -> list[ArmSample]:
        drawn = [sampler.draw(rng, 8) for sampler, rng in zip(samplers, rngs, strict=True)]
        none = np.zeros((0, 0), dtype=np.intp)
        return [ArmSample(q[:0], none, 8, None, q) for q in drawn]

    cell = planar(1, 4)
    assert copose.solve(copose.parse(cell), effort="low").status == "solved"
    with monkeypatch.context() as patch:
        patch.setattr(global_search, "sample_together", nothing)
        unlucky = copose.solve(copose.parse(cell), effort="low")
        assert unlucky.status == "failed" and "'a1'" in unlucky.reason
        cell["object"]["position"] = [3.0, 0.1]
        far = copose.solve(copose.parse(cell), effort="low")
        assert far.status == "infeasible" and "no posture within its limits" in far.reason


@pytest.mark.parametrize(("duration", "status"), [(0.15, "infeasible"), (0.4, "failed")])
def test_only_a_bound_says_that_a_path_is_too_fast(duration: float, status: str) -> None:
    cell = single_hinged(12, duration=duration)
    for arm in cell["arms"]:
        arm["velocity_limits"] = [1.0, 1.0, 1.0]
    motion = copose.plan(copose.parse(cell))
    assert motion.status == status
    assert motion.reason.endswith("(speed)")
    assert ("whatever the posture" in motion.reason) == (status == "infeasible")


# Closed motions: postures of two arms in four layers, and moves between them.


def closing(values: list[np.ndarray], moves: list[list[np.ndarray]]) -> list:
    """Closed routes that are found where the last layer has the postures of the first."""
    count = len(values[0])
    q = 3.0 * np.arange(count)[:, None]
    arm = SimpleNamespace(
        layers=[SimpleNamespace(q=q)] * len(values), apart=lambda many, other: many - other
    )
    finder = RouteFinder.__new__(RouteFinder)
    finder._roadmaps = (arm, arm)
    finder._ends = [np.arange(count)] * 2
    finder._count = len(values)
    finder._worth = RouteCost("mean", 0.0, 1.0, (np.ones(1), np.ones(1)))
    one, other = ([Moves(costs) for costs in mine] for mine in moves)
    return finder._closed((0, 1), Lattice(values, one, other))


@pytest.mark.parametrize("together", [False, True])
def test_every_beginning_of_a_closed_motion_counts(together: bool) -> None:
    count, layers = 12, 4
    rng = np.random.default_rng(3)
    stay = np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    # The best beginnings of the first arm come back to others: only the last one to itself.
    turned = np.roll(stay, 1, axis=1)
    turned[-2:], turned[:, -1] = np.inf, np.inf
    turned[-2, 0] = turned[-1, -1] = 0.0
    values = [rng.uniform(0, 1, (count, count)) for _ in range(layers)]
    values[0][:-1] += 10.0
    moves = [[stay, stay, stay if together else turned], [stay] * 3]
    if together:
        # All come back alone; together only the worst pair does.
        values[2][:] = -np.inf
        values[2][-1, -1] = 0.5
    found = closing(values, moves)
    best = max(
        np.mean([value[i, j] for value in values])
        for i, j in itertools.product(range(count), range(count))
        if together or i == count - 1
    )
    assert found
    assert max(route.worth for route in found) == pytest.approx(best)
    for route in found:
        assert (route.nodes[0] == route.nodes[-1]).all()


class Nowhere(PostureConstraint):
    """A constraint that no posture keeps."""

    name = "nowhere"

    @classmethod
    def of(cls, cell: Cell, *, moving: bool) -> Nowhere:
        return cls()

    def allows(self, context: object, q: list[np.ndarray]) -> np.ndarray:
        return np.zeros(len(q[0]), dtype=bool)

    def kept(self, posture: object) -> bool:
        return False


@pytest.mark.parametrize(
    ("arms", "joints", "kind", "status"),
    [(1, 2, "volume", "infeasible"), (1, 3, "volume", "failed"), (2, 3, "payload", "failed")],
)
def test_the_reason_names_a_constraint_that_allows_no_posture(
    arms: int, joints: int, kind: str, status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With a payload torque limits matter, and would be blamed.
    cell = planar(arms, joints)
    cell["objective"] = {"kind": kind}
    cell["world"] = {"gravity": [0.0, -9.81]}
    for arm in cell["arms"]:
        arm["torque_limits"] = [100.0] * joints
    assert copose.solve(copose.parse(cell)).status == "solved"

    def with_another(cell: Cell) -> tuple[PostureConstraint, ...]:
        return (*constraints_of(cell), Nowhere())

    monkeypatch.setattr(copose.posture.model, "constraints_of", with_another)
    solution = copose.solve(copose.parse(cell))
    assert solution.reason == "no posture that was compared keeps the constraint 'nowhere'"
    assert solution.status == status
