"""Points of the unit cube: even, each dimension with its own irrational step, and by seed."""

from __future__ import annotations

import numpy as np
import pytest

from copose.low_discrepancy import points


def steps(dimension: int) -> np.ndarray:
    first, second = points(2, dimension, np.random.default_rng(3))
    return (second - first) % 1.0


@pytest.mark.parametrize("dimension", [1, 2, 3, 6, 12])
def test_steps_are_the_powers_of_the_root(dimension: int) -> None:
    roots = np.roots([1.0, *[0.0] * (dimension - 1), -1.0, -1.0])
    (root,) = roots[(abs(roots.imag) < 1e-12) & (roots.real > 1)].real
    assert steps(dimension) == pytest.approx(1 / root ** np.arange(1, dimension + 1), abs=1e-12)


def test_the_golden_ratio_leaves_gaps_of_three_lengths() -> None:
    values = np.sort(points(1000, 1, np.random.default_rng(0))[:, 0])
    gaps = np.diff([*values, values[0] + 1])
    assert len(np.unique(gaps.round(9))) <= 3
    assert gaps.max() < 3 * gaps.min()


@pytest.mark.parametrize(("dimension", "cells"), [(1, 128), (2, 12), (3, 5), (6, 2)])
def test_no_cell_of_a_grid_is_empty(dimension: int, cells: int) -> None:
    for seed in range(20):
        where = points(4 * cells**dimension, dimension, np.random.default_rng(seed))
        assert len(np.unique((where * cells).astype(int), axis=0)) == cells**dimension


def test_a_mean_is_nearer_than_that_of_random_points() -> None:
    def errors(draw) -> np.ndarray:
        means = [np.cos(draw(512, 2, np.random.default_rng(k))).prod(1).mean() for k in range(40)]
        return abs(np.array(means) - np.sin(1.0) ** 2)

    random = errors(lambda count, dimension, rng: rng.random((count, dimension)))
    assert np.median(errors(points)) < np.median(random) / 5


def test_points_are_in_the_cube_and_of_their_seed() -> None:
    one, same, other = (points(100_000, 3, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert (one == same).all()
    assert (one != other).all()
    assert ((one >= 0) & (one < 1)).all()
    assert points(0, 3, np.random.default_rng(0)).shape == (0, 3)
