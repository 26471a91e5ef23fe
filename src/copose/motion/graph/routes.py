"""Routes through the arms' roadmaps: the best by dynamic programming on the cost itself."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from copose.motion.graph.dynamic_programming import Far, Found, Lattice, Moves
from copose.motion.graph.node_values import NodeValues
from copose.motion.graph.roadmap import Roadmap
from copose.poses import Array, Indices, Mask
from copose.selection import far_apart

Aggregate: TypeAlias = Literal["mean", "worst"]


@dataclass(frozen=True)
class RouteOptions:
    """Options of the search for routes."""

    # Cost of moves that are faster than joints may be, by the excess squared: their routes come
    # after all others, and the program, which has finer knots, may mend them.
    too_fast: float = 1e4
    allowed: float = 1.3  # spacings that the time between layers always allows
    peaked: int = 8  # power of times of moves whose sum stands in for the largest
    drawn: int = 8  # random routes that exchange improves, of more than two arms
    sweeps: int = 8  # of exchange over all arms, at most
    gain: float = 1e-9  # least improvement
    polished: int = 2  # best of these routes, which are improved by two arms at a time
    beginnings: int = 8  # combinations that a closed motion may begin with which are followed
    looked_at: int = 256  # the same, looked at where the arms let few of them return together
    begin_apart: tuple[float, ...] = (0.5, 0.0)  # of these, rad or m, at first and at last


@dataclass(frozen=True, eq=False)
class Route:
    """A route: a posture of every layer for each arm."""

    nodes: Indices  # numbers of the postures, (layers, K)
    worth: float  # aggregate − smoothness · S, less a fine for moves that are too fast


@dataclass(frozen=True, eq=False)
class RouteCost:
    """The cost of a route."""

    aggregate: Aggregate  # of the objective over the layers
    smoothness: float  # s²/rad², of the mean of squared speeds
    interval: float  # between layers, s
    speeds: tuple[Array, ...]  # limits by arm, (n,)
    options: RouteOptions = RouteOptions()  # of the search

    @property
    def joints(self) -> int:
        """The number of joints of all arms."""
        return sum(map(len, self.speeds))

    def costs(self, roadmap: Roadmap, i: int) -> list[Array]:
        """Costs of the moves of arm i, by layer after the first, infinite where there is none."""
        moves, options = roadmap.layers[1:], self.options
        costs = []
        for layer in moves:
            # One spacing is the least that a move beside can be: less time does not rule it out.
            span = max(
                self.interval, options.allowed * roadmap.spacing / float(self.speeds[i].min())
            )
            over = np.maximum(layer.pace(self.speeds[i]) / span - 1.0, 0.0)
            fine = layer.length < np.inf
            cost = np.full(layer.length.shape, np.inf)
            speed = layer.length[fine] / (self.joints * self.interval**2)
            cost[fine] = (self.smoothness * speed + options.too_fast * over[fine] ** 2) / len(moves)
            costs.append(cost)
        return costs


class RouteFinder:
    """The search for routes through the roadmaps of all arms.

    Attributes:
        values: of combinations of postures.
        lattice: of one or two arms; None of more.
    """

    def __init__(
        self,
        values: NodeValues,
        roadmaps: Sequence[Roadmap],
        worth: RouteCost,
        *,
        returns: bool,
        seed: int,
    ) -> None:
        """Evaluate the moves, and all combinations of one or two arms."""
        self.values, self._roadmaps, self._worth = values, tuple(roadmaps), worth
        self._returns, self._seed = returns, seed
        self._count = len(roadmaps[0].layers)
        self._every = tuple(range(len(roadmaps)))
        self._moves = [
            [Moves(costs) for costs in worth.costs(roadmap, i)]
            for i, roadmap in enumerate(roadmaps)
        ]
        self._ends = [roadmap.ends() for roadmap in roadmaps] if returns else []
        self.lattice: Lattice | None = None
        if len(roadmaps) <= 2:
            pairs = [values.pairs(k) for k in range(self._count)]
            self.lattice = self._held(self._moving(pairs, self._moves), self._roadmaps)

    def _moving(self, values: Sequence[Array], moves: Sequence[Sequence[Moves]]) -> Lattice:
        still = [Moves(np.zeros((1, 1)))] * (self._count - 1)
        return Lattice(values, moves[0], moves[1] if len(moves) > 1 else still)

    @staticmethod
    def _held(lattice: Lattice, roadmaps: Sequence[Roadmap]) -> Lattice:
        for axis, roadmap in enumerate(roadmaps):
            for k, number in zip((0, -1), roadmap.held, strict=True):
                lattice = lattice if number is None else lattice.only(k, axis, number)
        return lattice

    def routes(self, most: int, distance: float) -> list[Route]:
        """Routes that differ in some layer by more than a distance, rad or m; best first."""
        if self.lattice is None:
            routes = self._exchanged()
        elif self._returns:
            routes = self._closed(self._every, self.lattice)
        else:
            routes = self._far_apart(self.lattice, most, distance, self._aggregated)

        def far(route: Route, taken: Sequence[Route]) -> bool:
            return all(self._apart(route, other) > distance for other in taken)

        return far_apart(sorted(routes, key=lambda route: -route.worth), far, most)

    @property
    def single(self) -> bool:
        """True of one or two arms without a degree of freedom to spare: routes are branches, all of
        them known.
        """
        return self.lattice is not None and not any(r.spare for r in self._roadmaps)

    def every(self, most: int) -> list[Route]:
        """Every route, best first, of arms without a degree of freedom to spare; none of other
        arms, or where there would be more than ``most``.
        """
        if any(roadmap.spare for roadmap in self._roadmaps):
            return []
        branches = [roadmap.branches(most, returns=self._returns) for roadmap in self._roadmaps]
        if math.prod(map(len, branches)) > most:
            return []
        routes = [
            Route(np.column_stack(nodes), self._worth_of(np.column_stack(nodes)))
            for nodes in itertools.product(*branches)
        ]
        usable = [route for route in routes if np.isfinite(route.worth)]
        return sorted(usable, key=lambda route: -route.worth)

    def _worth_of(self, nodes: Indices) -> float:
        """Aggregate − smoothness · S of a route, (layers, K)."""
        alone = (0,)
        values = np.array(
            [self.values.partial(k, alone, chosen)[chosen[0], 0] for k, chosen in enumerate(nodes)]
        )
        moves = [
            layer.costs[a, b]
            for j, arm in enumerate(self._moves)
            for layer, a, b in zip(arm, nodes[:-1, j], nodes[1:, j], strict=True)
        ]
        mean = self._worth.aggregate == "mean"
        return float((values.mean() if mean else values.min()) - np.sum(moves))

    def quickest(self, most: int, distance: float) -> list[Route]:
        """Routes whose slowest moves take the least time, about, that differ as in `routes`; of one
        or two arms, the ends of which need not be the same.
        """
        if self.lattice is None or self._returns:
            return []
        least = self.least_interval()
        if not 0 < least < np.inf:
            return []
        power = self._worth.options.peaked
        paces = [
            [Moves((layer.pace(speed) / least) ** power) for layer in roadmap.layers[1:]]
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
            [Moves(layer.pace(speed)) for layer in roadmap.layers[1:]]
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
            apart = [r.apart(own[many], own[one]) for r, own, many, one in parts]
            return np.asarray(np.abs(np.hstack(apart)).max(axis=1) > distance)

        paths = best(lattice, most, far if most > 1 else None)
        return [Route(path.nodes[:, : len(q)], path.worth) for path in paths]

    def _aggregated(self, lattice: Lattice, most: int, far: Far | None = None) -> list[Found]:
        weighed = [values / self._count for values in lattice.values]
        mean = Lattice(weighed, lattice.one, lattice.other).best(most, far)
        if self._worth.aggregate == "mean":
            return mean
        paths = lattice.levelled(most, far)
        if far is not None:
            # What is good on average may be made good everywhere, and differs more.
            paths += [Found(path.nodes, lattice.worst_of(path, weighed)) for path in mean]
        return paths

    def _closed(self, arms: tuple[int, ...], lattice: Lattice) -> list[Route]:
        """Routes of one or two arms that end with the combination that they begin with, of the
        most promising.
        """
        alone = lattice.returning(*(self._ends[i] for i in arms))
        ends = [*alone, np.zeros(1, dtype=np.intp)][:2]
        bound = lattice.reversed
        # What may follow the first combinations, come what may in the end.
        promise = np.where(np.isfinite(lattice.values[0]), 0.0, -np.inf)
        promise[ends[0] < 0] = -np.inf
        promise[:, ends[1] < 0] = -np.inf
        promise = promise + self._following(bound)
        order = np.argsort(np.where(np.isfinite(promise), -promise, np.inf).ravel(), kind="stable")
        order = order[: int(np.isfinite(promise).sum())]
        tried: list[tuple[int, int]] = []
        routes: list[Route] = []
        options = self._worth.options
        for apart in options.begin_apart:
            for number in order:
                i, j = (int(x) for x in np.unravel_index(number, promise.shape))
                if len(routes) == options.beginnings or len(tried) == options.looked_at:
                    break
                if any(self._alike(arms, (i, j), known, apart) for known in tried):
                    continue
                tried.append((i, j))
                held = lattice.only(0, 0, i).only(0, 1, j)
                held = held.only(-1, 0, int(ends[0][i])).only(-1, 1, int(ends[1][j]))
                best = self._aggregated(held, 1) if held.open else []
                routes += [Route(path.nodes[:, : len(arms)], path.worth) for path in best]
            if routes:
                break
        return routes

    def _following(self, backward: Lattice) -> Array:
        if self._worth.aggregate == "worst":
            return backward.widest
        weighed = [values / self._count for values in backward.values]
        return Lattice(weighed, backward.one, backward.other).ending

    def _alike(
        self, arms: tuple[int, ...], one: tuple[int, ...], other: tuple[int, ...], apart: float
    ) -> bool:
        if one == other:
            return True
        roadmaps = [self._roadmaps[i] for i in arms]
        return all(
            np.abs(r.apart(r.layers[0].q[a], r.layers[0].q[b])).max() < apart
            for r, a, b in zip(roadmaps, one, other, strict=False)
        )

    def _exchanged(self) -> list[Route]:
        """Random routes, improved arm by arm with the others fixed until none gets better, and the
        best of them two arms at a time.
        """
        routes = []
        rng = np.random.default_rng([self._seed, len(self._roadmaps), 7])
        single = [(i,) for i in self._every]
        for number in range(self._worth.options.drawn):
            columns = []
            for i, roadmap in enumerate(self._roadmaps):
                drawn = [rng.uniform(size=(len(layer.q), 1)) for layer in roadmap.layers]
                own = self._best_of((i,), drawn)
                if own is None:
                    return []
                columns.append(own.nodes[:, 0])
            route = Route(np.column_stack(columns), -np.inf)
            if number % 2 and self._worth.aggregate == "worst":
                # What is good on average is a different place to start from.
                route = Route(self._of_means._swept(route, single).nodes, -np.inf)
            route = self._swept(route, single)
            routes += [route] if np.isfinite(route.worth) else []
        routes.sort(key=lambda route: -route.worth)
        double, best = list(itertools.combinations(self._every, 2)), self._worth.options.polished
        return [self._swept(route, double) for route in routes[:best]] + routes[best:]

    @property
    def _of_means(self) -> RouteFinder:
        """The search where the mean counts."""
        means = copy(self)
        means._worth = replace(self._worth, aggregate="mean")
        return means

    def _swept(self, route: Route, groups: Sequence[tuple[int, ...]]) -> Route:
        """A route improved by groups of arms, one after the other, until none gets better."""
        since, most = 0, self._worth.options.sweeps * len(groups)
        for arms in itertools.islice(itertools.cycle(groups), most):
            better = self._exchange(route, arms)
            since = since + 1 if better.worth <= route.worth + self._worth.options.gain else 1
            route = better if better.worth > route.worth else route
            if since == len(groups) and np.isfinite(route.worth):
                break
        return route

    def _exchange(self, route: Route, arms: tuple[int, ...]) -> Route:
        """The route with the best ones of some arms, those of the others as they are."""
        values = [self.values.partial(k, arms, nodes) for k, nodes in enumerate(route.nodes)]
        better = self._best_of(arms, values)
        if better is None:
            return route
        nodes = route.nodes.copy()
        nodes[:, list(arms)] = better.nodes
        costs = [
            layer.costs[a, b]
            for j, moves in enumerate(self._moves)
            if j not in arms
            for layer, a, b in zip(moves, nodes[:-1, j], nodes[1:, j], strict=True)
        ]
        return Route(nodes, better.worth - float(sum(costs)))

    def _best_of(self, arms: tuple[int, ...], values: Sequence[Array]) -> Route | None:
        """The best route of one or two arms; where the motion is closed, back to its beginning."""
        moving = self._moving(values, [self._moves[i] for i in arms])
        lattice = self._held(moving, [self._roadmaps[i] for i in arms])
        if self._returns:
            return max(self._closed(arms, lattice), key=lambda route: route.worth, default=None)
        best = next(iter(self._aggregated(lattice, 1)), None)
        return None if best is None else Route(best.nodes[:, : len(arms)], best.worth)

    def _apart(self, one: Route, other: Route) -> float:
        """The largest difference of a joint in any layer, rad or m."""
        return max(
            float(np.abs(r.apart(layer.q[a], layer.q[b])).max())
            for r, own, other_nodes in zip(self._roadmaps, one.nodes.T, other.nodes.T, strict=True)
            for layer, a, b in zip(r.layers, own, other_nodes, strict=True)
        )
