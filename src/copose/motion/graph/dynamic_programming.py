"""Dynamic programming over one or two arms' postures, layer by layer.

The value of a route is a sum over layers of the combination's value, less the cost of moves, which
is a sum over the arms: so two passes a layer, an arm each, look at every combination of moves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.progress import heed

Far = Callable[[Indices, Indices, int, int], Mask]
"""The combinations of the middle layer, by rows and columns, that are far from one of them."""


@dataclass(frozen=True, eq=False)
class Found:
    """A route through a lattice: its combinations, (layers, 2), and its worth."""

    nodes: Indices
    worth: float


@dataclass(frozen=True, eq=False)
class Moves:
    """Moves of an arm from a layer to the next."""

    costs: Array  # ∞ where there is no move, (count before, count)

    @cached_property
    def arrivals(self) -> tuple[Indices, Array]:
        """Predecessors of each posture, and the costs of moves from them, (few, count) each: a
        posture has few moves to it, and only these are compared.
        """
        columns, rows = np.nonzero(np.isfinite(self.costs.T))
        place = np.arange(len(rows)) - np.searchsorted(columns, columns)
        shape = int(place.max(initial=0)) + 1, self.costs.shape[1]
        before, costs = np.zeros(shape, dtype=np.intp), np.full(shape, np.inf)
        before[place, columns], costs[place, columns] = rows, self.costs[rows, columns]
        return before, costs

    @cached_property
    def allowed(self) -> Array:
        """Ones where there is a move, zeros elsewhere, as numbers that multiply quickly."""
        return np.isfinite(self.costs).astype(np.float32)

    @cached_property
    def back(self) -> Moves:
        """Moves from the next layer back to this one."""
        return Moves(self.costs.T)


@dataclass(frozen=True, eq=False)
class Lattice:
    """Combinations of two arms' postures and moves between them; one arm goes with a still one."""

    values: Sequence[Array]  # by layer, −∞ where a combination is not allowed, (count, count')
    one: Sequence[Moves]  # the first arm's moves by layer after the first
    other: Sequence[Moves]  # alike of the second

    def best(self, most: int, far: Far | None = None) -> list[Found]:
        """The best routes through combinations of the middle layer that are far apart."""
        last = len(self.values) - 1
        middle = last if far is None else len(self.values) // 2
        ahead, behind = _Table(self, middle), _Table(self.reversed, last - middle)
        total = ahead.worth + behind.worth
        usable = np.isfinite(total)
        total[usable] -= self.values[middle][usable]
        order = np.argsort(np.where(usable, -total, np.inf).ravel(), kind="stable")
        order = order[: int(usable.sum())]
        routes: list[Found] = []
        while len(order) and len(routes) < most:
            i, j = divmod(int(order[0]), total.shape[1])
            nodes = [*ahead.back(i, j)[::-1], *behind.back(i, j)[1:]]
            routes.append(Found(np.array(nodes, dtype=np.intp), float(total[i, j])))
            if far is None:
                break
            rows, columns = np.unravel_index(order, total.shape)
            order = order[far(rows, columns, i, j)]
        return routes

    def evenest(self, most: int, far: Far | None = None) -> list[Found]:
        """The routes whose least value is the largest that it can be."""
        highest = float(self.widest.max(initial=-np.inf))
        return self._above(highest, most, far) if np.isfinite(highest) else []

    def levelled(self, most: int, far: Far | None = None, levels: int = 12) -> list[Found]:
        """Routes of which the least value, not the sum, counts: at each of several levels that it
        may be at, the routes with the cheapest moves.
        """
        routes = self.evenest(most, far)
        if not routes:
            return []
        highest = float(self.widest.max())
        # Moves cost nothing at best: what is below the worth of a route cannot be worth more.
        lowest = max(route.worth for route in routes)
        for share in np.linspace(0.0, 1.0, levels)[1:-1] ** 2:
            level = highest - share * (highest - lowest)
            if level < max(route.worth for route in routes):
                break
            routes += self._above(level, most, far)
        return sorted(routes, key=lambda route: -route.worth)

    def _above(self, level: float, most: int, far: Far | None) -> list[Found]:
        """The routes with the cheapest moves of those whose least value reaches a level."""
        routes = []
        allowed = [np.where(value >= level, 0.0, -np.inf) for value in self.values]
        for route in Lattice(allowed, self.one, self.other).best(most, far):
            pairs = [tuple(pair) for pair in route.nodes]
            least = min(float(v[pair]) for v, pair in zip(self.values, pairs, strict=True))
            routes.append(Found(route.nodes, route.worth + least))
        return routes

    def worst_of(self, route: Found, weighed: Sequence[Array]) -> float:
        """The least value on a route, whose worth is of weighed values, less its cost of moves."""
        pairs = [tuple(pair) for pair in route.nodes]
        total = sum(float(value[pair]) for value, pair in zip(weighed, pairs, strict=True))
        least = min(float(value[pair]) for value, pair in zip(self.values, pairs, strict=True))
        return least - (total - route.worth)

    def least_of_largest(self) -> float:
        """The least that the largest cost of a move on a route can be; ∞ where there is none."""
        B = np.where(np.isfinite(self.values[0]), 0.0, np.inf)
        for value, one, other in zip(self.values[1:], self.one, self.other, strict=True):
            B = _least_before(_least_before(B, one).T, other).T
            B[~np.isfinite(value)] = np.inf
        return float(B.min(initial=np.inf))

    @property
    def ending(self) -> Array:
        """The worth of the best route to each combination of the last layer."""
        return _Table(self, len(self.values) - 1).worth

    @property
    def widest(self) -> Array:
        """The largest least value of routes to each combination of the last layer."""
        return self._widest()[-1]

    @property
    def open(self) -> bool:
        """True where there is a route."""
        came = np.isfinite(self.values[0])
        for value, one, other in zip(self.values[1:], self.one, self.other, strict=True):
            came = _count(one.allowed.T @ came) @ other.allowed > 0
            came &= np.isfinite(value)
        return bool(came.any())

    def returning(self, *ends: Indices) -> list[Indices]:
        """Numbers that the first layer's postures have in the last layer, by arm, (count,); −1 of
        those to which the arm cannot return through postures that go with some of the other's.

        Args:
            ends: the numbers by arm, −1 where one is not in the last layer.
        """
        returning = []
        for axis, (own, moves) in enumerate(zip(ends, (self.one, self.other), strict=False)):
            usable = [np.isfinite(value).any(axis=1 - axis) for value in self.values]
            came: Array = np.diag(usable[0]).astype(np.float32)
            for move, mask in zip(moves, usable[1:], strict=True):
                came = _count(came @ move.allowed)
                came[:, ~mask] = 0.0
            back = came[np.arange(len(own)), own] > 0
            returning.append(np.where(back, own, -1))
        return returning

    def reach(self) -> int:
        """The number of layers that routes come through: all of them where there is a route."""
        for k, widest in enumerate(self._widest()):
            if not np.isfinite(widest).any():
                return k
        return len(self.values)

    @property
    def reversed(self) -> Lattice:
        """The lattice from the last layer to the first."""
        one, other = ([moves.back for moves in arm[::-1]] for arm in (self.one, self.other))
        return Lattice(self.values[::-1], one, other)

    def only(self, k: int, axis: int, number: int) -> Lattice:
        """The lattice with all but one posture of an arm ruled out in a layer."""
        values = list(self.values)
        chosen = (slice(None),) * axis + (number,)
        kept = np.full_like(values[k], -np.inf)
        kept[chosen] = values[k][chosen]
        values[k] = kept
        return Lattice(values, self.one, self.other)

    def _widest(self) -> list[Array]:
        """By layer, the largest least value of routes to each combination."""
        widest = [self.values[0]]
        for value, one, other in zip(self.values[1:], self.one, self.other, strict=True):
            G = _widest_before(widest[-1], one)
            widest.append(np.minimum(_widest_before(G.T, other).T, value))
        return widest


def _count(ways: Array) -> Array:
    """Ones where there are ways, zeros where there is none."""
    return (ways > 0).astype(np.float32)


class _Table:
    """The worth of the best routes up to a layer, (count, count'), and where they come from."""

    def __init__(self, lattice: Lattice, layer: int) -> None:
        self.worth = np.asarray(lattice.values[0])
        # The first arm's posture before, told by its own after the move and the other's before it;
        # then the other's before, told by both after.
        self._first: list[Indices] = []
        self._second: list[Indices] = []
        moves = zip(lattice.values[1:], lattice.one, lattice.other, strict=True)
        for value, one, other in islice(moves, layer):
            G, first = _best_before(self.worth, one)
            worth, second = _best_before(G.T, other)
            self._first.append(first)
            self._second.append(second.T)
            self.worth = worth.T + value

    def back(self, i: int, j: int) -> list[tuple[int, int]]:
        """Postures of the best route that ends in a combination of the layer, last first."""
        nodes = [(i, j)]
        for first, second in zip(self._first[::-1], self._second[::-1], strict=True):
            j_before = int(second[i, j])
            i, j = int(first[i, j_before]), j_before
            nodes.append((i, j))
        return nodes


def _best_before(worth: Array, moves: Moves) -> tuple[Array, Indices]:
    """The largest worth with which each posture can be reached, and from which one before.

    Args:
        worth: of combinations with the other arm's, (count before, count').
        moves: to the next layer, (count before, count).

    Returns:
        (count, count') each.
    """
    heed()
    before, costs = moves.arrivals
    best = worth[before[0]] - costs[0][:, None]
    came = np.repeat(before[0][:, None], worth.shape[1], axis=1)
    # Not all at once, for processors keep little at hand.
    for rows, cost in zip(before[1:], costs[1:], strict=True):
        moved = np.flatnonzero(np.isfinite(cost))
        steps = worth[rows[moved]] - cost[moved, None]
        known = best[moved]
        better = steps > known
        best[moved] = np.where(better, steps, known)
        came[moved] = np.where(better, rows[moved, None], came[moved])
    return best, came


def _least_before(largest: Array, moves: Moves) -> Array:
    """The least that the largest cost of moves to each posture can be, (count, count')."""
    heed()
    least = np.full((moves.costs.shape[1], largest.shape[1]), np.inf)
    for rows, cost in zip(*moves.arrivals, strict=True):
        moved = np.flatnonzero(np.isfinite(cost))
        steps = np.maximum(largest[rows[moved]], cost[moved, None])
        least[moved] = np.minimum(least[moved], steps)
    return least


def _widest_before(widest: Array, moves: Moves) -> Array:
    """The largest least value with which each posture can be reached, (count, count')."""
    heed()
    before, costs = moves.arrivals
    steps = np.where(np.isfinite(costs)[:, :, None], widest[before], -np.inf)
    return np.asarray(steps.max(axis=0))
