"""What proofs rest on, tried at random: do slices meet every self-motion, and do bounds hold?

    python benchmarks/proofs.py completeness ROBOT ... [--poses 200] [--draws 20000] [--seed 0]
    python benchmarks/proofs.py soundness OBJECTIVE ... [--bounds 100000] [--cells NAME ...]

*Completeness*: poses of a robot's tip at random joints. Every posture that random joints are
projected to, within limits, has to be on a self-motion that the slices met; of an arm without a
joint to spare it has to be one of the postures that were found. Misses are listed, each piece of a
self-motion between limits once, with its length.

*Soundness*: random combinations of segments of the arms' self-motions, of several sizes, and a
random posture on each. The objective's value there has to be at most the bound of the segments, and
the terms of each arm on their side of the matrices that bound them.

Without names: all robots, or all objectives. Prints tables of Markdown.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from typing import Any

import building
import numpy as np
from cases import case
from scipy.spatial import cKDTree
from tables import table

import copose
from copose import kernels
from copose.cell.cell import Cell
from copose.poses import Array, Indices, Mask
from copose.posture.model import PostureModel
from copose.proof.arm_terms import ArmTerms
from copose.proof.combinations import CombinationSearchOptions
from copose.proof.segments import MotionSegments, SegmentOptions
from copose.proof.self_motions import PieceOptions, SelfMotions
from copose.proof.tubes import SelfMotionTubes
from copose.robots import finite_range
from copose.self_motion.curves.arc_length import Track
from copose.self_motion.curves.tracing import follow
from copose.self_motion.manifold import ClosureManifold
from copose.self_motion.projection import CLOSED, project
from copose.self_motion.slices.sliced_arm import SlicedArm

# Completeness.

SAME = 1e-5
"""Difference of joints that are the same, rad."""
SPACING = 0.008
"""Length of the pieces of which self-motions are made, rad."""
HERE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class KnownPostures:
    """Postures of an arm that are known: on pieces of self-motions, or single ones."""

    def __init__(self, manifold: ClosureManifold, pieces: Array) -> None:
        """Those on pieces, by postures at both ends, (count, 2, n)."""
        self._manifold, self._middles = manifold, pieces.mean(axis=1)
        along = pieces[:, 1] - pieces[:, 0]
        self._tangents = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        self._tree = cKDTree(_embedded(self._middles)) if len(pieces) else None

    def has(self, q: Array, nearest: tuple[int, ...] = (1, 64)) -> Mask:
        """Which of closed postures, (count, n), are on one of the nearest pieces."""
        known = np.zeros(len(q), dtype=bool)
        if self._tree is None:
            return known
        for count in nearest:
            left = np.flatnonzero(~known)
            ranks = [*range(1, count + 1)]
            for column in np.asarray(self._tree.query(_embedded(q[left]), k=ranks)[1]).T:
                there = column < len(self._middles)
                known[left[there]] |= self._on(q[left[there]], column[there])
        return known

    def _on(self, q: Array, rows: Indices) -> Mask:
        """Which of postures, (count, n), are what a step along a piece, one of each, ends at."""
        middles, tangents = self._middles[rows], self._tangents[rows]
        offset = np.angle(np.exp(1j * (q - middles)))
        if self._manifold.spare == 0:
            return np.asarray(np.abs(offset).max(axis=1) < SAME)
        along = (offset * tangents).sum(axis=1)
        still = np.zeros_like(middles)
        step = self._manifold.many(len(q)).step(middles, tangents, along, still, CLOSED)
        same = np.abs(step.q - middles - offset).max(axis=1) < SAME
        return np.asarray(step.closed & same & (np.abs(along) < SPACING))


def _embedded(q: Array) -> Array:
    """Postures as points that no whole turn moves, (count, 2n)."""
    return np.hstack([np.cos(q), np.sin(q)])


@dataclass
class Completeness:
    """What became of the poses of a robot."""

    poses: int = 0
    postures: int = 0  # drawn, within limits
    odd: int = 0  # slices whose count stayed odd
    ended: int = 0  # self-motions that were followed to a posture without a tangent
    misses: list[str] = field(default_factory=list)


class PosedRobot:
    """One arm, by itself, whose tip is to be at random poses."""

    def __init__(self, robot: str) -> None:
        """A robot by its name in ``building.ROBOTS``.

        Raises:
            ValueError: there is no complete inverse kinematics of it.
        """
        model = PostureModel(Cell.of(copose.parse(building.cell(robot, (robot,), 0)[0])))
        self._cell, self._kernels = model.cell, model.arms[0]
        kernels.build(self._kernels.all, wait=True)
        self._sliced = SlicedArm(self._cell.arms[0], self._kernels, self._cell.system.space)
        if self._sliced.fault is not None:
            raise ValueError(f"{robot} {self._sliced.fault}")
        setting, self._turns = model.setting(self._cell), self._cell.turns(0)
        self._lower, self._upper = setting.lower[0], setting.upper[0]

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        """Random joints within limits, (count, n)."""
        low, high = finite_range(self._cell.lower[0], self._cell.upper[0])
        return rng.uniform(low, high, (count, len(low)))

    def tried(self, rng: np.random.Generator, draws: int, seen: Completeness) -> None:
        """One more pose of the tip, that of random joints, and so many draws there."""
        own = self.drawn(rng, 1)
        goal = self._kernels.gap(own, HERE)[0]
        q, gaps = project(self._kernels, self.drawn(rng, draws), goal, self._lower, self._upper)
        q = np.vstack([own, q[gaps < CLOSED]])
        slices = self._sliced.at(goal)
        motions = SelfMotions.of(
            self._cell, self._kernels, 0, goal, slices, PieceOptions(step=SPACING)
        )
        missed = q[~KnownPostures(motions.manifold, motions.pieces).has(q)]
        for count, length, one in self._grouped(motions.manifold, missed):
            seen.misses.append(
                f"pose {seen.poses}, {count} of {len(q)} postures on a piece of {length:.3g} rad, "
                f"at {one.round(6).tolist()}"
            )
        seen.poses, seen.postures = seen.poses + 1, seen.postures + len(q)
        seen.odd, seen.ended = seen.odd + slices.odd, seen.ended + motions.ended

    def _grouped(self, manifold: ClosureManifold, q: Array) -> Iterator[tuple[int, float, Array]]:
        """Pieces of self-motions between limits on which postures, (count, n), are: how many are on
        each, its length, rad, and one of them.
        """
        while len(q):
            length, pieces = self._between_limits(manifold.goals[0], q[0])
            on = KnownPostures(manifold, pieces).has(q)
            on[0] = True
            yield int(on.sum()), length, q[0]
            q = q[~on]

    def _between_limits(self, goal: Array, q: Array) -> tuple[float, Array]:
        """The self-motion that a posture is on, from limit to limit: its length, and its pieces."""
        if self._kernels.n == self._kernels.m:
            return 0.0, np.stack([q, q])[None]
        manifold = ClosureManifold(
            self._kernels, goal[None], self._lower[None], self._upper[None], self._turns[None]
        )
        track = Track.of(follow(manifold, q[None])[0], self._cell.system.space.rigid)
        ends = track.closed(np.linspace(0.0, track.length, 2 + int(track.length / SPACING)))
        return track.length, np.stack([ends[:-1], ends[1:]], axis=1)


def completeness(robot: str, poses: int, draws: int, seed: int) -> Completeness:
    """Random poses of a robot; misses are printed as they come."""
    posed, seen, told = PosedRobot(robot), Completeness(), 0
    rng = np.random.default_rng(seed)
    for _ in range(poses):
        posed.tried(rng, draws, seen)
        for miss in seen.misses[told:]:
            print(f"{robot}, {miss}", flush=True)
        told = len(seen.misses)
    return seen


# Soundness.

UR5 = "ur5-pair"
CELLS = ("two-panda-box", "baxter-box", "xarm-bar", "paper-fig2", "two-planar-4r", UR5)
OBJECTIVES = (
    "volume", "torque-optimal-volume", "task-compatibility", "worst-direction", "isotropy",
    "velocity-volume", "force-volume",
)  # fmt: skip
SLICED = ("volume", "task-compatibility", "worst-direction", "isotropy")
"""Those that are bounded on some of the axes, too."""
TIMES, TIMES_UR5 = 8, 32
"""How often segments are drawn anew. Two UR5 have few postures: their cells are drawn."""
PIECES = 240
"""Pieces of self-motions of an arm of which segments are made."""
LONGEST, LOOSEST = 0.03, 1.0
"""Length of the longest pieces, rad, and distance of their bounds from the terms, relative."""
HALVED = 3
"""Times that a part of the segments is halved."""
AT_ONCE = 4000
"""Combinations that are tried together."""
ROUNDING = 1e-10
"""By which eigenvalues of terms may be wrong: postures are closed to 1e-13."""


def posed(name: str, objective: str, number: int, *, linear: bool) -> copose.Problem:
    """The problem of a cell with another objective, maybe on its linear axes alone."""
    tables = building.cell(name, ("ur5", "ur5"), number)[0] if name == UR5 else case(name).tables
    kind = "volume" if objective == "torque-optimal-volume" else objective
    asked: dict[str, Any] = {"kind": kind} | ({"axes": ["x", "y", "z"]} if linear else {})
    if kind == "task-compatibility":
        rng = np.random.default_rng(number)
        size = {"spatial": 6, "planar": 3, "planar-linear": 2}[tables["task"]["space"]]
        asked["directions"] = [
            {"direction": rng.normal(size=3 if linear else size).tolist(), "weight": weight}
            for weight in (1.0, -0.7, 0.4)
        ]
    resolution = "torque-optimal" if kind != objective else "pseudoinverse"
    ellipsoid = dict(tables.get("ellipsoid", {})) | {"resolution": resolution}
    rest = {key: value for key, value in tables.items() if key != "constraints"}
    return copose.parse(rest | {"objective": asked, "ellipsoid": ellipsoid})


@cache
def motions_of(name: str, number: int) -> tuple[tuple[SelfMotions, ...], ...]:
    """The self-motions of each arm of a cell, in pieces of two lengths."""
    model = PostureModel(Cell.of(posed(name, "volume", number, linear=False)))
    cell, goals = model.cell, model.setting(model.cell).placement.goals
    model.compiled(wait=True)
    found = []
    for i, own in enumerate(model.arms):
        slices = SlicedArm(cell.arms[i], own, cell.system.space).at(goals[i])
        found.append(tuple(
            SelfMotions.of(cell, own, i, goals[i], slices, PieceOptions(step=step))
            for step in (SPACING, LONGEST)
        ))  # fmt: skip
    return tuple(found)


@dataclass
class Soundness:
    """What became of the bounds of an objective on a cell."""

    bounds: int = 0
    violated: int = 0  # by more than what a search raises them by for their rounding
    margin: float = np.inf  # the smallest of a bound over the value
    none: int = 0  # segments for which there is no bound
    terms: int = 0  # matrices that bound an arm's terms, compared with these
    terms_violated: int = 0
    terms_margin: float = np.inf  # the smallest, relative


class BoundedCell:
    """A cell with segments of its arms' self-motions."""

    def __init__(
        self,
        problem: copose.Problem,
        motions: Sequence[Sequence[SelfMotions]],
        rng: np.random.Generator,
    ) -> None:
        """Enclose random pieces of the arms' self-motions."""
        self._model = PostureModel(Cell.of(problem))
        self._setting = self._model.setting(self._model.cell)
        self._model.compiled(wait=True)
        self._segments = [self._enclosed(i, own, rng) for i, own in enumerate(motions)]
        self._axes = list(problem.axes)

    def _enclosed(
        self, i: int, motions: Sequence[SelfMotions], rng: np.random.Generator
    ) -> MotionSegments:
        """Segments of arm i: as a proof begins, as long as can be proved, and halves of both."""
        cell, placement = self._model.cell, self._setting.placement
        objective, space = self._setting.objective, cell.system.space
        assert objective.form is not None
        tubes = SelfMotionTubes(cell.arms[i], space, placement.goals[i])
        terms = ArmTerms(tubes, objective.form, placement.ties[i])
        sides = objective.bound_sides(sliced=len(cell.problem.axes) < space.m)
        segments = MotionSegments(cell, i, terms, motions[0].manifold, sides)
        for each, loosest in zip(motions, (None, LOOSEST), strict=True):
            chosen = rng.permutation(len(each.pieces))[: PIECES // 2]
            segments.add(each.pieces[chosen], loosest)
        for _ in range(HALVED):
            count = len(segments.ends)
            segments.halved(np.flatnonzero(rng.uniform(size=count) < PIECES / 6 / count))
        return segments

    def tried(self, rng: np.random.Generator, seen: Soundness, most: int) -> None:
        """Compare bounds with values at random postures of random combinations of segments."""
        size = min(AT_ONCE, 2 * most)
        rows = [rng.integers(0, len(segments.ends), size) for segments in self._segments]
        drawn = [self._inside(i, own, rng) for i, own in enumerate(rows)]
        within = np.all([(part >= 0) & (part <= 1) for _, part in drawn], axis=0)
        keep = np.flatnonzero(within)[:most]
        rows, q, parts = ([own[keep] for own in each] for each in (rows, *zip(*drawn, strict=True)))
        bounds = self._bounds(rows)
        there = np.isfinite(bounds)
        margins = (bounds - self._model.measures(self._setting, q).objective)[there]
        slack = CombinationSearchOptions().rounding * np.maximum(1.0, np.abs(bounds[there]))
        seen.none += int((~there).sum())
        seen.bounds += len(margins)
        seen.violated += int((~(margins >= -slack)).sum())
        seen.margin = min(seen.margin, float(margins.min(initial=np.inf)))
        for i, (own, chosen, part) in enumerate(zip(q, rows, parts, strict=True)):
            for margins in self._term_margins(i, own, chosen, part):
                seen.terms += len(margins)
                seen.terms_violated += int((~(margins >= -ROUNDING)).sum())
                seen.terms_margin = min(seen.terms_margin, float(margins.min(initial=np.inf)))

    def _inside(self, i: int, rows: Indices, rng: np.random.Generator) -> tuple[Array, Array]:
        """Random closed postures of segments of arm i, and how far along each they are, 0 … 1."""
        segments, own = self._segments[i], self._model.arms[i]
        ends, w = segments.ends[rows], rng.uniform(0, 1, (len(rows), 1))
        free = np.full(own.n, np.inf)
        start = (1 - w) * ends[:, 0] + w * ends[:, 1]
        q, gaps = project(own, start, self._setting.placement.goals[i], -free, free)
        middle, v, _ = segments.middles(ends)
        t, more = ((q - middle) * v).sum(axis=1), SegmentOptions().ends
        a, b = (((end - middle) * v).sum(axis=1) for end in (ends[:, 0], ends[:, 1]))
        a, b = a - more, b + more
        return q, np.where(gaps < CLOSED, (t - a) / (b - a), np.nan)

    def _bounds(self, chosen: Sequence[Indices]) -> Array:
        """Bounds of combinations of segments, before a search raises them for their rounding."""
        M_o = self._matrices(self._setting.placement.inertia[None])[0]
        each = zip(self._segments, chosen, strict=True)
        ends = [segments.bounds[..., rows].swapaxes(0, 1) for segments, rows in each]
        corners = np.stack([sum(corner) for corner in product(*ends)])
        return self._setting.objective.upper_bounds(corners, M_o)

    def _matrices(self, entries: Array) -> Array:
        """Symmetric matrices of their upper triangles, (count, s), in the axes of the problem."""
        m = self._model.cell.system.space.m
        rows, columns = np.triu_indices(m)
        whole = np.empty((len(entries), m, m))
        whole[:, rows, columns] = whole[:, columns, rows] = entries
        return whole[:, self._axes][:, :, self._axes]

    def _term_margins(self, i: int, q: Array, rows: Indices, part: Array) -> Iterator[Array]:
        """By matrix, how far the terms of arm i are on their side of its bound, relative."""
        segments = self._segments[i]
        terms = self._model.arms[i].terms(q, self._setting.placement.ties[i])
        m = self._model.cell.system.space.m
        size = m * (m + 1) // 2
        for side, (term, upper) in enumerate(segments.sides):
            G = self._matrices(terms[:, size * term : size * (term + 1)])
            low, high = np.moveaxis(segments.bounds[side][..., rows], -1, 1)
            V = (1 - part[:, None, None]) * low + part[:, None, None] * high
            L = np.linalg.inv(np.linalg.cholesky(G))
            values = np.linalg.eigvalsh(L @ V @ L.swapaxes(1, 2))
            yield np.asarray(values[:, 0] - 1 if upper else 1 - values[:, -1])


def soundness(objective: str, name: str, bounds: int, seed: int) -> Soundness:
    """Bounds of an objective on a cell, half of them on its linear axes where it has others."""
    two = objective in SLICED and case(name).tables["task"]["space"] == "spatial"
    rng, seen = np.random.default_rng(seed), Soundness()
    times = TIMES_UR5 if name == UR5 else TIMES
    for k in range(times):
        number = k if name == UR5 else 0
        problem = posed(name, objective, number, linear=two and k % 2 == 1)
        cell = BoundedCell(problem, motions_of(name, number), rng)
        while (left := bounds * (k + 1) // times - seen.bounds) > 0:
            cell.tried(rng, seen, left)
    return seen


# What is printed.


def completeness_rows(asked: argparse.Namespace) -> Iterator[list[str]]:
    """A row a robot."""
    for robot in asked.names or ("ur5", "xarm7"):
        began = time.process_time()
        seen = completeness(robot, asked.poses, asked.draws, asked.seed)
        yield [robot, *(str(x) for x in (seen.poses, seen.postures, len(seen.misses), seen.odd,
               seen.ended)), f"{time.process_time() - began:.0f}"]  # fmt: skip


def soundness_rows(asked: argparse.Namespace) -> Iterator[list[str]]:
    """A row an objective and a cell; the bounds are shared out among the cells."""
    for objective in asked.names or OBJECTIVES:
        for k, name in enumerate(asked.cells):
            began, count = time.process_time(), len(asked.cells)
            share = asked.bounds * (k + 1) // count - asked.bounds * k // count
            seen = soundness(objective, name, share, asked.seed)
            yield [
                f"{objective}, {name}", str(seen.bounds), str(seen.violated), f"{seen.margin:.1e}",
                str(seen.none), str(seen.terms), str(seen.terms_violated),
                f"{seen.terms_margin:.1e}", f"{time.process_time() - began:.0f}",
            ]  # fmt: skip


CAMPAIGNS: dict[str, tuple[Callable[[argparse.Namespace], Iterator[list[str]]], list[str]]] = {
    "completeness": (
        completeness_rows,
        ["robot", "poses", "postures", "misses", "odd slices", "ended", "processor s"],
    ),
    "soundness": (
        soundness_rows,
        ["objective, cell", "bounds", "violated", "least margin", "without a bound",
         "terms of arms", "violated", "least margin, relative", "processor s"],
    ),
}  # fmt: skip


def main() -> None:
    """Try and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", choices=CAMPAIGNS)
    parser.add_argument("names", nargs="*", help="robots, or objectives")
    parser.add_argument("--poses", type=int, default=200, help="of each robot")
    parser.add_argument("--draws", type=int, default=20_000, help="at each pose")
    parser.add_argument("--bounds", type=int, default=100_000, help="of each objective")
    parser.add_argument("--cells", nargs="+", choices=CELLS, default=CELLS)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rows_of, heads = CAMPAIGNS[asked.campaign]
    rows = []
    for row in rows_of(asked):
        rows.append(row)
        print(*row, sep=", ", flush=True)
    print(f"\n{table(heads, rows)}")


if __name__ == "__main__":
    main()
