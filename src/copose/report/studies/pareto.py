"""Two numbers of which more cannot be had of one without less of the other."""

from __future__ import annotations

import numpy as np

from copose.poses import Array, Indices


def pareto_front(one: Array, other: Array) -> Indices:
    """The points that no other point beats: none is at least as large in both numbers and larger
    in one. Of equal points the first counts.

    Args:
        one: a number of each point, nan where there is none, (count,).
        other: alike.

    Returns:
        Their numbers, by ``one`` descending, so that ``other`` ascends.
    """
    known = np.flatnonzero(np.isfinite(one) & np.isfinite(other))
    order = known[np.lexsort((-other[known], -one[known]))]
    highest = np.maximum.accumulate(other[order])
    front = np.ones(len(order), dtype=bool)
    front[1:] = other[order][1:] > highest[:-1]
    return order[front]
