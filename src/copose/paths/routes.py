"""The best routes through the arms' roadmaps, by dynamic programming on the cost itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from copose.paths.lattice import Far, Found, Lattice
from copose.paths.roadmap import Roadmap
from copose.paths.values import Values
from copose.poses import Array, Indices, Mask

Aggregate: TypeAlias = Literal["mean", "worst"]

# What moves cost that are faster than joints may be, by the excess squared: their routes come after
# all others, and the program, which has finer knots, may mend them.
_TOO_FAST = 1e4
_BESIDE = 1.3
# The power of times of moves whose sum stands in for the largest.
_PEAKED = 8
# Random routes that exchange improves where there are more than two arms, and sweeps.
_DRAWN, _SWEEPS, _GAIN = 8, 8, 1e-9
# Combinations that a closed motion may begin with of which so many are tried, some rad or m apart.
_BEGINNINGS, _BEGIN_APART = 8, 0.5


@dataclass(frozen=True, eq=False)
class Route:
    """A posture of every layer for each arm.

    Attributes:
        nodes: their numbers, (layers, K).
        worth: aggregate − smoothness · S, less a fine for moves that are too fast.
    """

    nodes: Indices
    worth: float


@dataclass(frozen=True, eq=False)
class Worth:
    """What counts of a route.

    Attributes:
        aggregate: of the objective over the layers.
        smoothness: s²/rad², of the mean of squared speeds.
        interval: between layers, s.
        speeds: limits by arm, (n,).
    """

    aggregate: Aggregate
    smoothness: float
    interval: float
    speeds: tuple[Array, ...]

    @property
    def joints(self) -> int:
        """Of all arms."""
        return sum(map(len, self.speeds))

    def costs(self, roadmap: Roadmap, i: int) -> list[Array]:
        """Of the moves of arm i, by layer after the first, infinite where there is none."""
        moves = roadmap.layers[1:]
        found = []
        for layer in moves:
            # One spacing is the least that a move beside can be: less time does not rule it out.
            span = max(self.interval, _BESIDE * roadmap.spacing / float(self.speeds[i].min()))
            over = np.maximum(layer.pace(self.speeds[i]) / span - 1.0, 0.0)
            fine = layer.length < np.inf
            cost = np.full(layer.length.shape, np.inf)
            speed = layer.length[fine] / (self.joints * self.interval**2)
            cost[fine] = (self.smoothness * speed + _TOO_FAST * over[fine] ** 2) / len(moves)
            found.append(cost)
        return found


class Finder:
    """Finds routes through the roadmaps of all arms.

    Attributes:
        values: of combinations of postures.
        lattice: of one or two arms; None of more.
    """

    def __init__(
        self,
        values: Values,
        roadmaps: Sequence[Roadmap],
        worth: Worth,
        *,
        returns: bool,
        seed: int,
    ) -> None:
        """Evaluate the moves, and all combinations of one or two arms."""
        self.values, self._roadmaps, self._worth = values, tuple(roadmaps), worth
        self._returns, self._seed = returns, seed
        self._count = len(roadmaps[0].layers)
        self._costs = [worth.costs(roadmap, i) for i, roadmap in enumerate(roadmaps)]
        self._ends = [roadmap.ends() for roadmap in roadmaps] if returns else []
        self.lattice: Lattice | None = None
        if len(roadmaps) <= 2:
            pairs = [values.pairs(k) for k in range(self._count)]
            self.lattice = self._held(self._moving(pairs, self._costs), self._roadmaps)

    def _moving(self, values: Sequence[Array], costs: Sequence[Sequence[Array]]) -> Lattice:
        still = [np.zeros((1, 1))] * (self._count - 1)
        return Lattice(values, costs[0], costs[1] if len(costs) > 1 else still)

    @staticmethod
    def _held(lattice: Lattice, roadmaps: Sequence[Roadmap]) -> Lattice:
        for axis, roadmap in enumerate(roadmaps):
            for k, number in zip((0, -1), roadmap.held, strict=True):
                lattice = lattice if number is None else lattice.only(k, axis, number)
        return lattice

    def routes(self, most: int, distance: float) -> list[Route]:
        """Routes that differ in some layer by more than a distance, rad or m; best first."""
        if self.lattice is None:
            found = self._exchanged()
        elif self._returns:
            found = self._closed(self.lattice)
        else:
            found = self._best(self.lattice, most, distance)
        chosen: list[Route] = []
        for route in sorted(found, key=lambda each: -each.worth):
            if len(chosen) < most and all(self._apart(route, c) > distance for c in chosen):
                chosen.append(route)
        return chosen

    def quickest(self, most: int, distance: float) -> list[Route]:
        """Routes whose slowest moves take the least time, about, that differ as in `routes`; of one
        or two arms, the ends of which need not be the same.
        """
        if self.lattice is None or self._returns:
            return []
        least = self.least_interval()
        if not 0 < least < np.inf:
            return []
        paces = [
            [(layer.pace(speed) / least) ** _PEAKED for layer in roadmap.layers[1:]]
            for roadmap, speed in zip(self._roadmaps, self._worth.speeds, strict=True)
        ]
        allowed = [np.where(np.isfinite(v), 0.0, -np.inf) for v in self.lattice.values]
        return self._far_apart(self._moving(allowed, paces), most, distance, Lattice.best)

    def evenest(self, most: int, distance: float) -> list[Route]:
        """Routes whose worst combination is the best that it can be, that differ as in `routes`, of
        one or two arms, not closed: where all hold too much, those of the least largest share.
        """
        if self.lattice is None or self._returns:
            return []
        return self._far_apart(self.lattice, most, distance, Lattice.evenest)

    def least_interval(self) -> float:
        """The least time between layers, s, in which some route's slowest joints can follow it."""
        paces = [
            [layer.pace(speed) for layer in roadmap.layers[1:]]
            for roadmap, speed in zip(self._roadmaps, self._worth.speeds, strict=True)
        ]
        if self.lattice is not None:
            moving = self._moving(self.lattice.values, paces)
            return moving.least_of_largest()
        alone = []
        for roadmap, pace in zip(self._roadmaps, paces, strict=True):
            any_ = [np.zeros((len(layer.q), 1)) for layer in roadmap.layers]
            moving = self._held(self._moving(any_, [pace]), [roadmap])
            alone.append(moving.least_of_largest())
        return max(alone)

    def slowest(self) -> tuple[int, int, int]:
        """The arm, its joint and the layer whose move is the most too fast on the best route."""
        worst, where = -np.inf, (0, 0, 0)
        for route in self.routes(1, np.inf):
            for i, (roadmap, nodes) in enumerate(zip(self._roadmaps, route.nodes.T, strict=True)):
                for k, layer in enumerate(roadmap.layers[1:]):
                    pace = np.abs(layer.moves[nodes[k], nodes[k + 1]]) / self._worth.speeds[i]
                    if pace.max() > worst:
                        worst, where = float(pace.max()), (i, int(pace.argmax()), k + 1)
        return where

    def postures(self, route: Route) -> Array:
        """Stacked joints of every layer, unwrapped, (layers, N)."""
        columns = []
        for roadmap, nodes in zip(self._roadmaps, route.nodes.T, strict=True):
            q = [roadmap.layers[0].q[nodes[0]]]
            for layer, before, after in zip(roadmap.layers[1:], nodes, nodes[1:], strict=False):
                q.append(q[-1] + layer.moves[before, after])
            columns.append(np.array(q))
        return np.hstack(columns)

    def _best(self, lattice: Lattice, most: int, distance: float) -> list[Route]:
        return self._far_apart(lattice, most, distance, self._aggregated)

    def _far_apart(
        self,
        lattice: Lattice,
        most: int,
        distance: float,
        best: Callable[[Lattice, int, Far | None], list[Found]],
    ) -> list[Route]:
        """Routes that differ in the middle layer by more than a distance."""
        middle = self._count // 2
        q = [roadmap.layers[middle].q for roadmap in self._roadmaps]

        def far(rows: Indices, columns: Indices, i: int, j: int) -> Mask:
            parts = zip(self._roadmaps, q, (rows, columns), (i, j), strict=False)
            apart = [r.apart(mine[some], mine[one]) for r, mine, some, one in parts]
            return np.asarray(np.abs(np.hstack(apart)).max(axis=1) > distance)

        found = best(lattice, most, far if most > 1 else None)
        K = len(self._roadmaps)
        return [Route(each.nodes[:, :K], each.worth) for each in found]

    def _aggregated(self, lattice: Lattice, most: int, far: Far | None = None) -> list[Found]:
        weighed = [values / self._count for values in lattice.values]
        mean = Lattice(weighed, lattice.one, lattice.other).best(most, far)
        if self._worth.aggregate == "mean":
            return mean
        found = lattice.levelled(most, far)
        if far is not None:
            # What is good on average may be made good everywhere, and differs more.
            found += [Found(each.nodes, lattice.worst_of(each, weighed)) for each in mean]
        return found

    def _closed(self, lattice: Lattice) -> list[Route]:
        """Routes that end with the combination that they begin with, of the most promising."""
        ends = [*self._ends, np.zeros(1, dtype=np.intp)][:2]
        bound = lattice.reversed
        # What may follow the first combinations, come what may in the end.
        promise = np.where(np.isfinite(lattice.values[0]), 0.0, -np.inf)
        promise[ends[0] < 0] = -np.inf
        promise[:, ends[1] < 0] = -np.inf
        promise = promise + self._following(bound)
        order = np.argsort(np.where(np.isfinite(promise), -promise, np.inf).ravel(), kind="stable")
        tried: list[tuple[int, int]] = []
        found: list[Route] = []
        for number in order[: int(np.isfinite(promise).sum())]:
            i, j = (int(x) for x in np.unravel_index(number, promise.shape))
            if len(tried) == _BEGINNINGS:
                break
            if any(self._beside((i, j), known) for known in tried):
                continue
            tried.append((i, j))
            held = lattice.only(0, 0, i).only(0, 1, j)
            held = held.only(-1, 0, int(ends[0][i])).only(-1, 1, int(ends[1][j]))
            found += self._best(held, 1, np.inf)
        return found

    def _following(self, backward: Lattice) -> Array:
        if self._worth.aggregate == "worst":
            return backward.widest
        weighed = [values / self._count for values in backward.values]
        return Lattice(weighed, backward.one, backward.other).ending

    def _beside(self, one: tuple[int, ...], other: tuple[int, ...]) -> bool:
        return all(
            np.abs(r.apart(r.layers[0].q[a], r.layers[0].q[b])).max() < _BEGIN_APART
            for r, a, b in zip(self._roadmaps, one, other, strict=False)
        )

    def _exchanged(self) -> list[Route]:
        """Random routes, improved arm by arm beside the others' until none gets better."""
        found = []
        rng = np.random.default_rng([self._seed, len(self._roadmaps), 7])
        for _ in range(_DRAWN):
            columns = []
            for i, roadmap in enumerate(self._roadmaps):
                drawn = [rng.uniform(size=(len(layer.q), 1)) for layer in roadmap.layers]
                mine = self._alone(i, drawn, None)
                if mine is None:
                    return []
                columns.append(mine.nodes[:, 0])
            nodes, worth = np.column_stack(columns), -np.inf
            for _ in range(_SWEEPS):
                before = worth
                for i in range(len(self._roadmaps)):
                    worth = self._exchange(nodes, i, worth)
                if not worth > before + _GAIN:
                    break
            if np.isfinite(worth):
                found.append(Route(nodes, worth))
        return found

    def _exchange(self, nodes: Indices, i: int, worth: float) -> float:
        """Put the best route of arm i beside the others' in its place; what all come to then."""
        values = [self.values.beside(k, i, nodes[k])[:, None] for k in range(self._count)]
        better = self._alone(i, values, int(nodes[0, i]) if self._returns else None)
        if better is None:
            return worth
        nodes[:, i] = better.nodes[:, 0]
        others = [
            cost[a, b]
            for j, costs in enumerate(self._costs)
            if j != i
            for cost, a, b in zip(costs, nodes[:-1, j], nodes[1:, j], strict=True)
        ]
        return better.worth - float(sum(others))

    def _alone(self, i: int, values: Sequence[Array], begin: int | None) -> Found | None:
        """The best route of one arm; where the motion is closed, back to where it begins."""
        lattice = self._held(self._moving(values, [self._costs[i]]), [self._roadmaps[i]])
        if self._returns:
            ends = self._ends[i]
            if begin is None:
                first = np.where(ends >= 0, lattice.values[0][:, 0], -np.inf)
                if not np.isfinite(first).any():
                    return None
                begin = int(first.argmax())
            lattice = lattice.only(0, 0, begin).only(-1, 0, int(ends[begin]))
        return next(iter(self._aggregated(lattice, 1)), None)

    def _apart(self, one: Route, other: Route) -> float:
        """The largest difference of a joint in any layer, rad or m."""
        return max(
            float(np.abs(r.apart(layer.q[a], layer.q[b])).max())
            for r, mine, theirs in zip(self._roadmaps, one.nodes.T, other.nodes.T, strict=True)
            for layer, a, b in zip(r.layers, mine, theirs, strict=True)
        )
