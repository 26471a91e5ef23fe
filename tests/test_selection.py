"""Greedy selection: what is taken is apart, what is left out is near to something taken before."""

from __future__ import annotations

import numpy as np
import pytest

from copose.selection import far_apart, far_apart_rows


@pytest.mark.parametrize("distance", [0.0, 0.05, 0.3])
def test_both_ways_take_the_first_of_near_points(distance: float) -> None:
    points = np.random.default_rng(0).uniform(size=(200, 2))
    gaps = np.linalg.norm(points[:, None] - points, axis=2)
    rows = far_apart_rows(np.ones(200, dtype=bool), lambda row, _: gaps[row] <= distance)
    assert (gaps[np.ix_(rows, rows)] > distance).sum() == len(rows) * (len(rows) - 1)
    for row in sorted({*range(200)} - {*rows}):
        assert min(gaps[row, k] for k in rows if k < row) <= distance
    taken = far_apart(range(200), lambda k, before: all(gaps[k, j] > distance for j in before))
    assert taken == rows


def test_no_more_are_taken_than_asked_for_and_only_free_ones() -> None:
    free = np.array([False, True, True, True])
    assert far_apart_rows(free, lambda row, left: np.array([row]), 2) == [1, 2]
    assert free.tolist() == [False, True, True, True]
    assert far_apart("abc", lambda item, before: True, 2) == ["a", "b"]
