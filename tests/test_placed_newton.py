"""Newton steps over joints and all that is free: slopes, curvature, closure, ends and races."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cells import planar, two_pandas
from copose.cell.cell import Cell
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.placement.nlp import PlacementNlp
from copose.posture.placement.samples import PlacementSampler
from copose.posture.placement.search import PlacementSearch
from copose.posture.placement.starts import PlacementStarts
from copose.posture.search.effort import EFFORTS
from copose.posture.solvers.active_set import Iterates
from copose.posture.solvers.placed_newton import PlacedPolisher
from copose.problem import parse
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.tangent_space import ChainTangent, Tangent

CASES = [
    {"name": "one", "position": [0.5, 0.4], "weight": 2.0},
    {"name": "two", "position": [0.4, 0.6], "mass": 4.0},
]


def planar_cell(*, cases: bool) -> dict:
    """Two planar arms whose object, base and grasp may be moved, and turned."""
    cell = planar(2, 4, "planar")
    cell["object"]["freedom"] = {"x": [-0.1, 0.1], "angle": [-0.4, 0.4]}
    cell["arms"][1]["freedom"] = {"base": {"y": [-0.2, 0.2], "yaw": [-0.3, 0.3]}}
    cell["arms"][0]["freedom"] = {"grasp": {"x": [-0.05, 0.05]}}
    if cases:
        cell["cases"] = CASES
    return cell


def spatial_cell() -> dict:
    """Two Pandas, of which one may be moved on its table, and the box turned."""
    cell = two_pandas()
    cell["object"]["freedom"] = {"z": [-0.1, 0.1], "yaw": [-0.3, 0.3]}
    cell["arms"][1]["freedom"] = {"base": {"x": [-0.1, 0.2], "yaw": [-0.2, 0.2]}}
    return cell


def polisher_of(data: dict) -> tuple[PostureModel, PlacementNlp, PlacedPolisher, Array]:
    """A polisher, the program of the same problem, and closed starts, (count, v)."""
    model = PostureModel(Cell.of(parse(data)))
    cases = model.cell.cases
    weights = [case.weight for case in model.cell.problem.cases] or [1.0]
    program = PlacementNlp(model, cases, weights)
    sampler = PlacementSampler(model.places, cases, 0)
    options = EFFORTS["normal"].placing
    starter = PlacementStarts(model, weights, 0, options, newton=True)
    starts = []
    for x in sampler.scattered(6, 0):
        xs = sampler.everywhere(x)
        settings = [program.setting(k, x) for k in range(len(cases))]
        starts += starter.glanced(xs, settings)[:3]
    nominal = [program.setting(k, x) for k, x in enumerate(sampler.nominal)]
    polisher = model.placed_polisher(nominal, weights)
    assert len(starts) >= 6
    return model, program, polisher, np.array([program.stacked(start) for start in starts])


def point_at(polisher: PlacedPolisher, z: Array) -> Iterates:
    return polisher.point([z[:, None]], [np.zeros((len(z), 1, z.shape[1]), dtype=bool)])


@pytest.mark.parametrize("which", ["planar", "cases", "spatial"])
def test_slopes_are_those_of_finite_differences(which: str) -> None:
    data = spatial_cell() if which == "spatial" else planar_cell(cases=which == "cases")
    _, program, polisher, z = polisher_of(data)
    J, slope = polisher.slopes(0, point_at(polisher, z))
    h = 1e-6
    for column in range(z.shape[1]):
        step = np.zeros(z.shape[1])
        step[column] = h
        ahead, behind = point_at(polisher, z + step), point_at(polisher, z - step)
        expected = (ahead.value - behind.value) / (2 * h)
        assert np.allclose(slope[:, column], expected, rtol=2e-5, atol=2e-5)
        residuals = [polisher._residual(z + sign * step) for sign in (1, -1)]
        assert np.allclose(J[:, :, column], (residuals[0] - residuals[1]) / (2 * h), atol=1e-6)
    # What is climbed is what the program maximises.
    stated = [program._evaluated(row).value for row in z]
    assert np.allclose(point_at(polisher, z).value, stated, rtol=0, atol=1e-9)


@pytest.mark.parametrize("cases", [False, True])
def test_the_hessian_is_what_a_step_is_worth_once_it_is_closed(cases: bool) -> None:
    """Second differences of the value along every direction of the basis, far from any optimum."""
    *_, polisher, z = polisher_of(planar_cell(cases=cases))
    wide = polisher.blocks[0]
    wide = replace(wide, lower=wide.lower - 10, upper=wide.upper + 10)
    polisher = replace(polisher, blocks=[wide])
    point = point_at(polisher, z)
    tangent = polisher._tangent(0, point)
    H, h = polisher.hessian(point, tangent), 3e-4
    for k in range(H.shape[1]):
        values = []
        for reach in (-h, 0.0, h):
            step = [tangent.basis[:, k : k + 1]]
            closes, there = polisher._retracted(
                point.q, step, np.full(len(z), reach), [point.held[0]]
            )
            assert closes.all()
            values.append(there.value)
        curvature = (values[2] - 2 * values[1] + values[0]) / h**2
        scale = np.abs(H).max(axis=(1, 2))
        assert np.all(np.abs(H[:, k, k] - curvature) < 1e-3 * (1 + scale))


@pytest.mark.parametrize("which", ["planar", "cases"])
def test_ends_are_optima_of_the_program(which: str) -> None:
    """IPOPT goes no further from where Newton steps have converged."""
    _, program, polisher, z = polisher_of(planar_cell(cases=which == "cases"))
    ends = polisher.polish(z)
    assert ends.converged.mean() > 0.8
    assert np.all(ends.value >= point_at(polisher, z).value - 1e-9)
    low, high = polisher.blocks[0].lower[0], polisher.blocks[0].upper[0]
    assert np.all((ends.q >= low) & (ends.q <= high))
    assert np.abs(polisher._residual(ends.q)).max() < 1e-9
    for row in np.flatnonzero(ends.converged)[:6]:
        start = program.placed(ends.q[row], float(ends.value[row]))
        assert program.climb(start).value - start.value < 1e-7


def test_programs_go_on_from_the_best_ends_that_have_not_converged() -> None:
    """Two Newton steps are too few: the best of what they come to is an optimum all the same."""
    model = PostureModel(Cell.of(parse(planar_cell(cases=False))))
    search = PlacementSearch(model, model.cell, 0, EFFORTS["low"])
    polisher = search._polisher
    few = replace(polisher.options, iterations=2)
    search._polisher = replace(polisher, options=few)
    best, *others = search.run().optima
    assert search.polish(best).value - best.value < 1e-7
    assert any(search.polish(end).value - end.value > 1e-3 for end in others)


def test_where_limits_stop_an_arm_all_is_closed_together() -> None:
    """With as many joints stopped as it has to spare, and one more, what is free has to move."""
    *_, polisher, z = polisher_of(planar_cell(cases=False))
    low, high = polisher.blocks[0].lower[0], polisher.blocks[0].upper[0]
    stopped = np.zeros(z.shape[1], dtype=bool)
    stopped[:2] = True
    moved = z + np.where(stopped, 0.0, np.random.default_rng(0).uniform(-0.01, 0.01, z.shape))
    moved = np.clip(moved, low, high)
    lower, upper = (np.where(stopped, moved, limit)[:, None] for limit in (low, high))
    ends, closes = polisher.closed(0, moved[:, None], lower, upper)
    assert closes.mean() > 0.8
    assert np.array_equal(ends[:, 0, stopped], moved[:, stopped])
    assert np.abs(polisher._residual(ends[closes, 0])).max() < 1e-9


def test_a_race_counts_every_start_that_joins_another() -> None:
    *_, polisher, z = polisher_of(planar_cell(cases=False))
    many = np.repeat(z, 3, axis=0)
    ends = polisher.polish(many, ((0, len(z)),))
    going = np.isfinite(ends.error)
    assert going.sum() <= len(z)
    assert ends.met[going].sum() == len(many)
    alone = polisher.polish(z)
    for value in ends.value[going & ends.converged]:
        assert np.abs(alone.value - value).min() < 1e-8


def test_tangent_spaces_of_any_rank_and_any_held_joints() -> None:
    """Bases by reflections span what singular value decompositions span, whatever is held."""
    rng = np.random.default_rng(3)
    J, slope = rng.normal(size=(400, 4, 7)), rng.normal(size=(400, 7))
    held = rng.random((400, 7)) < 0.25
    J[:50, 3] = J[:50, 2]
    tangent = Tangent.of(J, slope, held)
    for k in range(len(J)):
        free = np.flatnonzero(~held[k])
        null = np.linalg.svd(J[k][:, free])[2][np.linalg.matrix_rank(J[k][:, free]) :]
        basis = tangent.basis[k]
        assert not basis[:, held[k]].any()
        # Where the rank is less there are more directions than rows of a basis: it spans some.
        spanned = basis[:, free]
        assert np.allclose(spanned @ null.T @ null, spanned, atol=1e-9)
        if np.linalg.matrix_rank(J[k]) == 4 == np.linalg.matrix_rank(J[k][:, free]):
            assert np.linalg.matrix_rank(spanned) == len(null)
        # Multipliers of least squares over the joints that are not held.
        expected = np.linalg.lstsq(J[k][:, free].T, slope[k, free], rcond=None)[0]
        left = slope[k] - J[k].T @ expected
        assert np.allclose(tangent.left[k, free], left[free], atol=1e-7)


@pytest.mark.parametrize("links", [4, 5])
def test_a_newton_step_takes_second_derivatives_along_self_motions(links: int) -> None:
    """Of the weighted terms less what closure costs, by differences; held joints do not move."""
    cell = Cell.of(parse(planar(2, links, "planar")))
    kernels = ArmKernels.of(cell.system.arms[0], cell.resolution)
    rng, d = np.random.default_rng(8), links - 3
    assert (kernels.line is None) == (d > 1)
    q, held = rng.uniform(-2, 2, (60, links)), rng.random((60, links)) < 0.15
    held[:5, :2] = True
    size, given = kernels.terms(q[:1], np.ones(kernels.terms._np)).shape[1], kernels.local._np
    x = np.hstack([q, rng.normal(size=(60, size))])
    goals = np.hstack(
        [np.tile([0.1, 0.2, 0, 1, 0, 0, 0], (60, 1)), rng.uniform(1, 2, (60, given - 7))]
    )
    tangent = ChainTangent.at(kernels, x, goals, held)
    expected = Tangent.of(tangent.J, tangent.slope, held)
    for k in range(60):
        assert np.allclose(tangent.left[k], expected.left[k], atol=1e-7)
        span = [basis[k].T @ basis[k] for basis in (tangent.basis, expected.basis)]
        assert np.allclose(*span, atol=1e-9)
        assert not tangent.basis[k][:, held[k]].any()

    def lagrangian(at: Array) -> Array:
        costs = (tangent.forces * kernels.residual(at, goals[:, :7])[0]).sum(axis=1)
        return (x[:, links:] * kernels.terms(at, goals[:, 7:])).sum(axis=1) - costs

    h = 1e-3
    for i in range(d):
        way = tangent.basis[:, i]
        ahead, here, behind = (lagrangian(q + s * h * way) for s in (1, 0, -1))
        bend = (ahead - 2 * here + behind) / h**2
        scale = 1 + np.abs(bend).max()
        assert np.allclose(tangent.bend[:, i, i], bend, atol=1e-3 * scale)
        ends = [kernels.terms(q + s * h * way, goals[:, 7:]) for s in (1, -1)]
        assert np.allclose(
            tangent.change[:, i], (ends[0] - ends[1]) / (2 * h), rtol=1e-3, atol=1e-3
        )


def test_corners_and_faces_of_the_ranges_are_tried() -> None:
    model = PostureModel(Cell.of(parse(spatial_cell())))
    grid = PlacementSampler(model.places, model.cell.cases, 0).grid
    low, high = model.places.freedom.lower, model.places.freedom.upper
    assert len(np.unique(grid, axis=0)) == len(grid) == 1 + 2 * 4 + 2**4
    corners = ((grid == low) | (grid == high)).all(axis=1)
    assert corners.sum() == 2**4
    faces = ((grid == low) | (grid == high)).sum(axis=1) == 1
    assert faces.sum() == 2 * 4
