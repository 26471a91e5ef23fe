"""The best motion of planar 3-joint arms along a path, by a dense dynamic program, in numpy alone.

Space planar-linear, one or two arms, one redundant degree each. At every knot the self-motion of
each arm is a curve of postures: either of its end links at any angle, the other two by the cosine
rule with either bend. Among pairs of such nodes the maximum of aggregate − λ S is exact, and comes
to that of all motions from below: smoothness is a sum over arms, thus a step is two passes of
max-plus, one arm after the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from object_path import ObjectPath

_FINE = 2e-3  # of a smallest value
_FAR = 0.8  # rad between two knots that no good motion takes, where speeds have no limit


@dataclass(frozen=True)
class Route:
    """A motion on the grid: aggregate − λ S, both parts, and its joints, (knots, N)."""

    value: float
    aggregate: float
    S: float
    q: np.ndarray


class DenseProgram:
    """A problem's tables on a grid of ``around`` angles a link end."""

    def __init__(self, tables: dict, around: int = 120) -> None:
        assert tables["task"]["space"] == "planar-linear"
        assert tables.get("objective", {}).get("kind", "volume") == "volume"
        self.tables, self.arms, self.around = tables, tables["arms"], around
        settings = tables["path"]
        self.path = ObjectPath(tables)
        self.knots = settings.get("knots", 50)
        self.time = np.linspace(0.0, self.path.duration, self.knots)
        self.weight = settings.get("smoothness", 0.01)
        self.mode = settings.get("aggregate", "mean")
        self.layers = [self._layer(k) for k in range(self.knots)]

    def goal(self, i: int, time: float) -> np.ndarray:
        """Where tip i must be, (2,)."""
        now = self.path.at(time)
        grasp = self.arms[i].get("grasp", {}).get("position", [0.0, 0.0])
        return (now.position + now.rotation @ [*grasp, 0.0])[:2]

    def nodes(self, i: int, goal: np.ndarray) -> np.ndarray:
        """Closed postures of arm i within its limits, (count, 3)."""
        base = self.arms[i].get("base", {})
        start, origin = base.get("angle", 0.0), np.array(base.get("position", [0.0, 0.0]))
        l1, l2, l3 = (link["length"] for link in self.arms[i]["links"])
        away = goal - origin
        grid = (np.arange(self.around) + 0.5) * 2 * math.pi / self.around
        ends = np.column_stack([np.cos(grid), np.sin(grid)])
        found = []
        for sign in (1.0, -1.0):
            # The last link at the angles of the grid, and then the first: where one of the two
            # turns back, the other does not.
            a, b = _two_links(away - l3 * ends, l1, l2, sign)
            found.append(np.column_stack([a, b, grid]))
            b, c = _two_links(away - l1 * ends, l2, l3, sign)
            found.append(np.column_stack([grid, b, c]))
        angles = np.concatenate(found)
        angles = angles[np.isfinite(angles).all(axis=1)]
        q = _wrapped(np.diff(angles, axis=1, prepend=start))
        return q[self.within(i, q)]

    def within(self, i: int, q: np.ndarray) -> np.ndarray:
        """Which postures keep the limits."""
        limits = self.arms[i].get("position_limits")
        if limits is None:
            return np.ones(len(q), dtype=bool)
        margin = self.tables.get("constraints", {}).get("joint_margin", 0.0)
        low, high = np.array(limits, dtype=float).T
        return np.all((q >= low + margin) & (q <= high - margin), axis=1)

    def own(self, i: int, q: np.ndarray) -> np.ndarray:
        """A_iᵀA_i, A_i = M J⁺ + Jᵀ m/K, of postures (count, 3) of arm i: (count, 2, 2)."""
        arm = self.arms[i]
        angles = arm.get("base", {}).get("angle", 0.0) + np.cumsum(q, axis=1)
        along = np.stack([np.cos(angles), np.sin(angles)], axis=2)
        lengths = np.array([link["length"] for link in arm["links"]])
        joints = np.concatenate(
            [np.zeros((len(q), 1, 2)), np.cumsum(lengths[:, None] * along, axis=1)], axis=1
        )

        def jacobian(point: np.ndarray, last: int) -> np.ndarray:
            J = np.zeros((len(q), 2, 3))
            for j in range(last + 1):
                r = point - joints[:, j]
                J[:, 0, j], J[:, 1, j] = -r[:, 1], r[:, 0]
            return J

        M = np.tile(np.diag(np.array(arm.get("armature", [0.0] * 3), dtype=float)), (len(q), 1, 1))
        for k, link in enumerate(arm["links"]):
            J = jacobian(joints[:, k] + link["com"] * along[:, k], k)
            turns = (np.arange(3) <= k).astype(float)
            M += link["mass"] * J.swapaxes(1, 2) @ J + link["inertia"] * np.outer(turns, turns)
        J = jacobian(joints[:, 3], 2)
        load = self.tables["object"]["mass"] / len(self.arms)
        A = M @ np.linalg.pinv(J) + load * J.swapaxes(1, 2)
        return A.swapaxes(1, 2) @ A

    def values(self, grams: list[np.ndarray]) -> np.ndarray:
        """The log-volume of every combination, (n_1, n_2); of one arm (n_1, 1)."""
        G = grams[0][:, None]
        G = G + (grams[1][None] if len(grams) > 1 else 0.0)
        with np.errstate(all="ignore"):
            value = math.log(math.pi) - 0.5 * np.log(
                G[..., 0, 0] * G[..., 1, 1] - G[..., 0, 1] * G[..., 1, 0]
            )
        return np.where(np.isfinite(value), value, -np.inf)

    def best(self) -> Route | None:
        """The best motion on the grid, None where there is none."""
        if self.mode == "mean":
            return self._route([value / self.knots for _, value in self.layers], -np.inf)
        # The smallest value is a threshold; of those above it the smoothest motion counts. The
        # highest that a motion keeps is found by halving; a lower one may buy smoothness.
        zeros = [np.zeros(value.shape) for _, value in self.layers]
        found = self._route(zeros, -np.inf)
        if found is None:
            return None
        low, high = found.aggregate, min(float(value.max()) for _, value in self.layers)
        while high - low > _FINE:
            middle = (low + high) / 2
            route = self._route(zeros, middle)
            if route is None:
                high = middle
                continue
            found = max(found, route, key=lambda each: each.value)
            low = max(middle, route.aggregate)
        for threshold in np.linspace(max(found.aggregate, low - 0.1), low, 8):
            route = self._route(zeros, threshold)
            if route is not None:
                found = max(found, route, key=lambda each: each.value)
        return found

    def step(self, i: int, q: np.ndarray, q_next: np.ndarray) -> np.ndarray:
        """λ S's share of every step between nodes of arm i, inf beyond its speeds: (n, n_next)."""
        span = self.time[1] - self.time[0]
        limit = np.array(self.arms[i].get("velocity_limits", [_FAR / span] * 3))
        cost = np.zeros((len(q), len(q_next)))
        for j in range(3):
            speed = np.abs(self.change(i, q, q_next, j)) / span
            cost += np.where(speed <= limit[j], speed**2, np.inf)
        return cost * self.weight / ((self.knots - 1) * 3 * len(self.arms))

    def change(self, i: int, q: np.ndarray, q_next: np.ndarray, j: int) -> np.ndarray:
        """The shortest way of joint j from each posture of arm i to each next, (n, n_next)."""
        # A joint with limits has them within a turn, and no way round.
        way = q_next[None, :, j] - q[:, None, j]
        return _wrapped(way) if "position_limits" not in self.arms[i] else way

    def reached(self, q: np.ndarray, i: int, time: float, near: float = 0.12) -> np.ndarray:
        """The nodes of arm i at a time that its self-motion leads to from a posture."""
        nodes = self.nodes(i, self.goal(i, time))
        known = np.zeros(len(nodes), dtype=bool)
        front = q[None]
        while len(front):
            apart = np.max([np.abs(self.change(i, nodes, front, j)) for j in range(3)], axis=0)
            fresh = (apart.min(axis=1) < near) & ~known
            known |= fresh
            front = nodes[fresh]
        return nodes[known]

    def measured(self, q: np.ndarray) -> Route:
        """Aggregate and S of joints (knots, N) of all arms."""
        parts = np.split(q, len(self.arms), axis=1)
        grams = sum(self.own(i, part) for i, part in enumerate(parts))
        values = math.log(math.pi) - 0.5 * np.log(np.linalg.det(grams))
        aggregate = float(values.min() if self.mode == "worst" else values.mean())
        S = float(np.mean((np.diff(q, axis=0) / (self.time[1] - self.time[0])) ** 2))
        return Route(aggregate - self.weight * S, aggregate, S, q)

    def _layer(self, k: int) -> tuple[list[np.ndarray], np.ndarray]:
        """Nodes by arm, and their values."""
        nodes = []
        for i, arm in enumerate(self.arms):
            if k == 0 and "start" in arm:
                nodes.append(np.array(arm["start"], dtype=float)[None])
            else:
                nodes.append(self.nodes(i, self.goal(i, self.time[k])))
        return nodes, self.values([self.own(i, q) for i, q in enumerate(nodes)])

    def _route(self, gains: list[np.ndarray], threshold: float) -> Route | None:
        """The motion of the largest sum of gains − λ S, with every value above a threshold."""
        gains = [
            np.where(value >= threshold, gain, -np.inf)
            for gain, (_, value) in zip(gains, self.layers, strict=True)
        ]
        best, costs = [gains[0]], []
        for k in range(1, self.knots):
            before, after = self.layers[k - 1][0], self.layers[k][0]
            pairs = enumerate(zip(before, after, strict=True))
            costs.append([self.step(i, q, q_next) for i, (q, q_next) in pairs])
            sums = _passed(best[-1], costs[-1][0])
            if len(self.arms) > 1:
                sums = _passed(sums.T, costs[-1][1]).T
            best.append(sums + gains[k])
        if not best[-1].size or not np.isfinite(best[-1].max()):
            return None
        where = np.unravel_index(int(np.argmax(best[-1])), best[-1].shape)
        chosen = [where]
        for k in range(self.knots - 2, -1, -1):
            total = best[k] - costs[k][0][:, where[0], None]
            if len(self.arms) > 1:
                total = total - costs[k][1][None, :, where[1]]
            where = np.unravel_index(int(np.argmax(total)), total.shape)
            chosen.append(where)
        rows = [
            np.concatenate([nodes[at] for nodes, at in zip(layer, where, strict=False)])
            for (layer, _), where in zip(self.layers, reversed(chosen), strict=True)
        ]
        return self.measured(np.unwrap(np.array(rows), axis=0))


def _passed(best: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """max over a of best[a, b] − cost[a, a′], (n′, m)."""
    found = np.full((cost.shape[1], best.shape[1]), -np.inf)
    open_ = np.isfinite(best).any(axis=1)
    for after in range(cost.shape[1]):
        near = np.flatnonzero(np.isfinite(cost[:, after]) & open_)
        if len(near):
            found[after] = (best[near] - cost[near, after, None]).max(axis=0)
    return found


def _two_links(away: np.ndarray, a: float, b: float, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Absolute angles of two links that reach a point, (count, 2), with either bend; or NaN."""
    cosine = ((away**2).sum(axis=1) - a**2 - b**2) / (2 * a * b)
    with np.errstate(invalid="ignore"):
        bend = sign * np.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan))
    first = np.arctan2(away[:, 1], away[:, 0]) - np.arctan2(b * np.sin(bend), a + b * np.cos(bend))
    return first, first + bend


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in (−π, π]."""
    return math.pi - np.mod(math.pi - angles, 2 * math.pi)
