"""Local searches from many starts: Newton steps, IPOPT, and the distinct optima they end in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum, LocalSolve
from copose.posture.setting import Setting
from copose.posture.solvers.active_set import Polished
from copose.progress import attained, stage
from copose.selection import far_apart_rows


@dataclass(frozen=True)
class SameOptimum:
    """Tolerances within which ends of local searches are one optimum."""

    objective: float = 1e-6
    joints: float = 1e-3  # rad or m
    tie: float = 1e-8  # relative: optima that differ by less are of equal worth, as symmetry makes


@dataclass(frozen=True)
class ClimbOptions:
    """Options of local searches."""

    batch: int = 8  # starts that Newton steps climb from at a time
    first_batch: int = 12  # the same where each start takes a program: at first, as gains differ
    later_batch: int = 4  # and then
    hope: float = 10.0  # times the largest gain so far that the next start may gain
    finished: int = 10  # ends of Newton steps that IPOPT goes on from, at most
    near_best: float = 1e-2  # of the best objective, within which such an end matters
    stopped_share: int = 6  # one of so many starts that bodies stop is climbed from by IPOPT
    fewest_stopped: int = 4  # of them that are, at least
    same: SameOptimum = SameOptimum()


class LocalSearches:
    """Local searches so far: Newton steps along the self-motions first, then IPOPT.

    IPOPT solves the posture program where Newton steps do not meet its tolerance, and where the
    objective has kinks.

    Attributes:
        model: what is built.
        setting: where the object is.
        options: how starts are batched and ends compared.
        starts: how many were climbed from.
        ends: where climbs ended.
        failures: programs that ended nowhere.
    """

    def __init__(
        self,
        model: PostureModel,
        setting: Setting,
        most: int | None = None,
        options: ClimbOptions = ClimbOptions(),
        known: Sequence[LocalOptimum] = (),
    ) -> None:
        """Begin with nothing but optima of another search that are known and count among the ends.

        As many starts as are climbed from at most, so many ends IPOPT may go on from.
        """
        most = options.finished if most is None else most
        self._finished = min(most, options.finished)
        self._stopped = max(options.fewest_stopped, most // options.stopped_share)
        self.model, self.setting, self.options = model, setting, options
        self.starts = 0
        self.ends = list(known)
        self.failures: list[LocalSolve] = []

    @property
    def best(self) -> float:
        """The largest objective so far."""
        return max((end.objective for end in self.ends), default=-np.inf)

    def keep(self, q: Array, value: float, climbs: int = 1) -> None:
        """Count a posture, (N,), among the ends, with how many climbs ended in it."""
        self.ends.append(LocalOptimum(q, float(value), climbs))
        # A search that leaves out bodies which have to keep apart has no answer yet.
        if self.model.bodies is None or self.setting.bodies is not None:
            attained(float(value))

    @property
    def known(self) -> Array:
        """Postures in which climbs ended, (count, N)."""
        return np.array([end.q for end in self.ends])

    def postures(self, most: int) -> list[Array]:
        """Postures of the best ends by arm, (count_i, n_i), without repetition."""
        cell = self.setting.cell
        best = gathered(cell, self.ends, self.options.same)[:most]
        optima = np.array([optimum.q for optimum in best])
        parts = cell.system.split(optima) if len(optima) else []
        return [np.unique(part.round(9), axis=0) for part in parts]

    def responses(self, i: int, closed: Array, most: int) -> Array:
        """Local optima of the score of arm i alone, the others as in the best end, (count, n_i).

        Of its closed postures, (count, n_i), so many are polished at most.
        """
        model, setting = self.model, self.setting
        cell = setting.cell
        best = max(self.ends, key=lambda end: end.objective)
        parts = cell.system.split(best.q)
        terms = [model.terms(setting, j, q[None])[0] for j, q in enumerate(parts) if j != i]
        rest = np.asarray(sum(terms))
        scores = model.score.value(model.terms(setting, i, closed) + rest, setting.given)
        starts = closed[np.argsort(-scores[:, 0], kind="stable")[:most]]
        own = model.objective.sums.size(cell.system.space)
        ends = model.polisher(setting, i, rest[:own]).polish(starts)
        return np.asarray(ends.q[ends.converged])

    def unknown(self, starts: Array) -> Array:
        """Starts, of (count, N), in which no climb has ended."""
        ends, cell, least = self.known, self.setting.cell, self.options.same.joints
        new = [np.all(cell.distances(ends, q) > least) for q in starts]
        return np.asarray(starts[np.array(new, dtype=bool)])

    def add_promising(self, starts: Array, scores: Array) -> None:
        """Climb from starts, (count, N), with their scores, (count,), best first, until the next
        would have to gain far more than any has.
        """
        options, newton = self.options, self.model.objective.summable
        if self.model.objective.costly:
            self.add(starts)
            return
        gained, best = 0.0, -np.inf
        first, together = 0, options.batch if newton else options.first_batch
        while first < len(starts):
            rows = slice(first, first + together)
            if scores[first] + options.hope * gained < best:
                break
            ends = self.add(starts[rows])
            best = max(best, ends.max(initial=-np.inf))
            gained = max(gained, (ends - scores[rows]).max(initial=0.0))
            first = rows.stop
            together = options.batch if newton else options.later_batch

    def add(self, starts: Array) -> Array:
        """Climb from closed postures, (count, N); the scores where they end, (count,)."""
        model, setting = self.model, self.setting
        if len(starts) == 0:
            return np.zeros(0)
        stage("polishing", self.starts)
        self.starts += len(starts)
        if not model.objective.summable:
            return self._ascend(starts)
        ends = model.polisher(setting).polish(starts)
        held = model.feasibility.allowed(setting, ends.q)
        solved = ends.converged & model.objective.smooth & held
        for q, value in zip(ends.q[solved], ends.value[solved], strict=True):
            self.keep(q, value)
        left = self._left(ends, solved | ~held)
        # Where torque limits or bodies end a climb IPOPT climbs with them, from a start that keeps
        # them; but where not even the climb without them came up to the best, it is no use.
        stopped = np.flatnonzero(~held)
        if setting.bodies is not None:
            stopped = stopped[ends.value[stopped] > self.best]
        stopped = stopped[model.feasibility.allowed(setting, starts[stopped])]
        if setting.bodies is not None:
            scores = model.objectives(setting, starts[stopped])
            stopped = stopped[np.argsort(-scores, kind="stable")[: self._stopped]]
            self._stopped -= len(stopped)
        left = np.vstack([left, starts[stopped]])
        if model.objective.smooth:
            stalled = int((~solved).sum()) - len(left)
            if setting.bodies is not None:
                # What bodies stop has not failed.
                stalled -= int((~held).sum()) - len(stopped)
            self.failures += [LocalSolve(starts[0], False, "Stalled_Far_Below_Best", {})] * stalled
        self._solve(left)
        return np.where(ends.converged, ends.value, -np.inf)

    def _ascend(self, starts: Array) -> Array:
        """Climb by the objective's own ascent where it has one, else by IPOPT; which goes on from
        starts whose ascent ends better than the best that is allowed, but is not allowed itself.

        Returns:
            The objective where each ends, −inf where nowhere, (count,).
        """
        model, setting = self.model, self.setting
        constrained = bool(model.feasibility.constraints)
        arms = [model.manifold(setting, i) for i in range(len(model.arms))]
        parts = setting.objective.ascended(setting, arms, model.split(starts), race=not constrained)
        if parts is None:
            return self._solve(starts)
        ends = np.hstack(parts)
        values = np.full(len(ends), -np.inf)
        finished = np.flatnonzero(np.isfinite(ends).all(axis=1))
        values[finished] = model.objectives(setting, ends[finished])
        values[np.isnan(values)] = -np.inf
        kept = values > -np.inf
        kept[kept] = model.feasibility.allowed(setting, ends[kept])
        for q, value in zip(ends[kept], values[kept], strict=True):
            self.keep(q, value)
        stopped = np.flatnonzero(~kept & (values > self.best))
        values[~kept] = -np.inf
        values[stopped] = self._solve(starts[stopped])
        return values

    def _left(self, ends: Polished, settled: Mask) -> Array:
        """Ends that are not settled and that IPOPT has to go on from, (count, N)."""
        order = np.argsort(-ends.value, kind="stable")
        order = order[~settled[order] & np.isfinite(ends.value[order])]
        if self.model.objective.smooth:
            best = ends.value[settled].max(initial=-np.inf)
            near = order[ends.value[order] > best - self.options.near_best]
            return np.asarray(ends.q[near[: self._finished]])
        q, least = ends.q[order], self.options.same.joints
        return np.asarray(q[differing(self.setting.cell, q, least, self._finished)])

    def _solve(self, q: Array) -> Array:
        """Go on from postures, (count, N), by IPOPT.

        Returns:
            The objective where each ends, −inf where nowhere, (count,).
        """
        model, setting = self.model, self.setting
        if len(q) == 0:
            return np.zeros(0)
        # Smooth objectives are climbed without the programs.
        from copose.posture.local.nlp_cuts import NlpCuts

        ends = list(NlpCuts(model).solve(setting, q))
        values = model.objectives(setting, np.array([end.q for end in ends]))
        good = np.isfinite(values) & np.array([end.converged for end in ends])
        for end, value, fine in zip(ends, values, good, strict=True):
            if fine:
                self.keep(end.q, value)
            else:
                self.failures.append(end)
        return np.where(good, values, -np.inf)


def differing(
    cell: Cell, q: Array, least: float, most: int, known: Array | None = None
) -> list[int]:
    """Indices of postures, (count, N), that differ from all chosen before and from those known.

    Args:
        cell: the arms.
        q: postures; the first is chosen first.
        least: rad or m, by which some joint has to differ.
        most: indices at most.
        known: postures, (known, N), that are not chosen again.
    """
    chosen, window = list[int](), max(1, 2 * most)
    for first in range(0, len(q), window):
        rows, before = q[first : first + window], q[chosen]
        before = before if known is None else np.vstack([known, before])
        free = np.asarray((cell.distances(rows, before[:, None]) > least).all(axis=0))
        near = ~(cell.distances(rows, rows[:, None]) > least)
        chosen += [first + row for row in far_apart_rows(free, near, most - len(chosen))]
        if len(chosen) == most:
            break
    return chosen


def gathered(cell: Cell, ends: Sequence[LocalOptimum], same: SameOptimum) -> list[LocalOptimum]:
    """Distinct optima, best first, with how many climbs ended in each."""
    optima: list[LocalOptimum] = []
    ends = sorted(ends, key=lambda optimum: -optimum.objective)
    folded = cell.all_folded(np.array([end.q for end in ends])) if ends else ()
    for end, q in zip(ends, folded, strict=True):
        # Best first: those of the same objective stand last.
        for j in range(len(optima) - 1, -1, -1):
            known = optima[j]
            if known.objective - end.objective >= same.objective:
                optima.append(replace(end, q=q))
                break
            if cell.distances(known.q[None], q)[0] < same.joints:
                optima[j] = replace(known, count=known.count + end.count)
                break
        else:
            optima.append(replace(end, q=q))
    return _tie_broken(optima, same)


def _tie_broken(optima: list[LocalOptimum], same: SameOptimum) -> list[LocalOptimum]:
    """Optima with the first of the best in the order of joints first, so that no seed decides."""
    if not optima:
        return optima
    best = optima[0].objective
    tied = [o for o in optima if o.objective >= best - same.tie * max(1.0, abs(best))]
    rest = optima[len(tied) :]
    first = list(tied)
    for joint in range(len(tied[0].q)):
        least = min(o.q[joint] for o in first)
        first = [o for o in first if o.q[joint] <= least + same.joints]
    return [first[0], *(o for o in tied if o is not first[0]), *rest]
