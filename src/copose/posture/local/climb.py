"""Local optima from many starts: Newton steps, IPOPT, and which ends are the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from copose.cell.cell import Cell
from copose.poses import Array, Mask
from copose.posture.local.nlp_cuts import NlpCuts
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalOptimum
from copose.posture.setting import Setting
from copose.posture.solvers.newton import Polished
from copose.posture.solvers.nlp import LocalSolve
from copose.progress import attained, stage
from copose.selection import far_apart

SAME_OBJECTIVE = 1e-6
_SAME_JOINTS = 1e-3
# Optima that differ by less are of equal worth; symmetric cells have some.
_TIE = 1e-8
# Ends that did not converge matter where they come near the best.
_NEAR_BEST = 1e-2
# IPOPT goes on with one climb that bodies stop for so many starts, the best starts first.
_STOPPED = 6
# And with so many at least.
_FEWEST = 4
_KINKED = 10
# Starts that are polished at a time, and how many times the largest gain so far the next may hope
# for.
_AT_ONCE, _HOPE = 8, 10.0
# Where each takes a program by itself: at first, for gains differ more there, and then.
_FIRST, _FEW_AT_ONCE = 12, 4


class LocalSearches:
    """What polishing has come to so far.

    Newton steps along the self-motions come first. IPOPT solves the posture program where they do
    not meet its tolerance, and where the objective has kinks.
    """

    def __init__(self, model: PostureModel, setting: Setting, most: int = _KINKED) -> None:
        """Nothing polished yet; of what Newton steps leave so many are finished by IPOPT."""
        self._most, self._stopped = min(most, _KINKED), max(_FEWEST, most // _STOPPED)
        self.model, self.setting = model, setting
        self.starts = 0
        self.ends: list[LocalOptimum] = []
        self.failures: list[LocalSolve] = []

    @property
    def best(self) -> float:
        """The largest objective so far."""
        return max((end.objective for end in self.ends), default=-np.inf)

    def keep(self, q: Array, value: float) -> None:
        """Count a posture, (N,), among the ends."""
        self.ends.append(LocalOptimum(q, float(value), 1))
        # What pays no heed to bodies that have to keep apart is no answer.
        if self.model.bodies is None or self.setting.bodies is not None:
            attained(float(value))

    @property
    def known(self) -> Array:
        """Where polishing has ended, (count, N)."""
        return np.array([end.q for end in self.ends])

    def postures(self, most: int) -> list[Array]:
        """By arm, where the best ends of polishing are, without repetition."""
        cell = self.setting.cell
        optima = np.array([optimum.q for optimum in gathered(cell, self.ends)[:most]])
        parts = cell.system.split(optima) if len(optima) else []
        return [np.unique(part.round(9), axis=0) for part in parts]

    def responses(self, i: int, closed: Array, most: int) -> Array:
        """Local optima of arm i alone beside the others' postures of the best end, (count, n_i);
        where no Newton step climbs, its best postures there.

        Args:
            i: the arm.
            closed: its postures to start from, (count, n_i).
            most: of them that are polished.
        """
        model, setting = self.model, self.setting
        cell = setting.cell
        best = max(self.ends, key=lambda end: end.objective)
        parts = cell.system.split(best.q)
        terms = [model.terms(setting, j, q[None])[0] for j, q in enumerate(parts) if j != i]
        rest = np.asarray(sum(terms))
        scores = model.score.value(model.terms(setting, i, closed) + rest, setting.given)
        scores = scores[:, 0]
        starts = closed[np.argsort(-scores, kind="stable")[:most]]
        if not model.newton:
            return np.asarray(starts)
        own = model.objective.sums.size(cell.system.space)
        ends = model.polisher(setting, i, rest[:own]).polish(starts)
        return np.asarray(ends.q[ends.converged])

    def unknown(self, starts: Array) -> Array:
        """Those of the starts that are no end."""
        ends = self.known
        cell = self.setting.cell
        new = [np.all(cell.distances(ends, q) > _SAME_JOINTS) for q in starts]
        return np.asarray(starts[np.array(new, dtype=bool)])

    def add_promising(self, starts: Array, scores: Array) -> None:
        """Polish starts, best first, until the next would have to gain far more than any has."""
        gained, best = 0.0, -np.inf
        first, together = 0, _AT_ONCE if self.model.newton else _FIRST
        while first < len(starts):
            rows = slice(first, first + together)
            if not self.model.dear and scores[first] + _HOPE * gained < best:
                break
            ends = self.add(starts[rows])
            best = max(best, ends.max(initial=-np.inf))
            gained = max(gained, (ends - scores[rows]).max(initial=0.0))
            first = rows.stop
            together = _AT_ONCE if self.model.newton else _FEW_AT_ONCE

    def add(self, starts: Array) -> Array:
        """Polish closed postures, (count, N); the scores where they end, (count,)."""
        model, setting = self.model, self.setting
        if len(starts) == 0:
            return np.zeros(0)
        stage("polishing", self.starts)
        self.starts += len(starts)
        if not model.newton:
            return self._solve(starts)
        ends = model.polisher(setting).polish(starts)
        held = model.allowed(setting, ends.q)
        solved = ends.converged & model.smooth & held
        values = model.objectives(setting, ends.q)
        for q, value in zip(ends.q[solved], values[solved], strict=True):
            self.keep(q, value)
        left = _left(setting.cell, ends, solved | ~held, model.smooth, self._most)
        # Where torque limits or bodies end a climb IPOPT climbs with them, from a start that keeps
        # them; but where not even the climb without them came up to the best, it is no use.
        stopped = np.flatnonzero(~held)
        if setting.bodies is not None:
            stopped = stopped[ends.value[stopped] > self.best]
        stopped = stopped[model.allowed(setting, starts[stopped])]
        if setting.bodies is not None:
            scores = model.objectives(setting, starts[stopped])
            stopped = stopped[np.argsort(-scores, kind="stable")[: self._stopped]]
            self._stopped -= len(stopped)
        left = np.vstack([left, starts[stopped]])
        if model.smooth:
            stalled = int((~solved).sum()) - len(left)
            if setting.bodies is not None:
                # What bodies stop has not failed.
                stalled -= int((~held).sum()) - len(stopped)
            self.failures += [LocalSolve(starts[0], False, "Stalled_Far_Below_Best", {})] * stalled
        self._solve(left)
        return np.where(ends.converged, ends.value, -np.inf)

    def _solve(self, q: Array) -> Array:
        """Go on from postures, (count, N), by IPOPT.

        Returns:
            The objective where each ends, −inf where nowhere, (count,).
        """
        model, setting = self.model, self.setting
        if len(q) == 0:
            return np.zeros(0)
        ends = list(NlpCuts(model).solve(setting, q))
        values = model.objectives(setting, np.array([end.q for end in ends]))
        good = np.isfinite(values) & np.array([end.converged for end in ends])
        for end, value, fine in zip(ends, values, good, strict=True):
            if fine:
                self.keep(end.q, value)
            else:
                self.failures.append(end)
        return np.where(good, values, -np.inf)


def _left(cell: Cell, ends: Polished, solved: Mask, smooth: bool, most: int) -> Array:
    """Ends that IPOPT has to go on from, (count, N)."""
    order = np.argsort(-ends.value, kind="stable")
    order = order[~solved[order] & np.isfinite(ends.value[order])]
    if smooth:
        best = ends.value[solved].max(initial=-np.inf)
        near = order[ends.value[order] > best - _NEAR_BEST]
        return np.asarray(ends.q[near[:most]])

    def far(q: Array, taken: Sequence[Array]) -> bool:
        return bool(np.all(cell.distances(np.array(taken), q) > _SAME_JOINTS))

    return np.array(far_apart(ends.q[order], far, most)).reshape(-1, ends.q.shape[1])


def gathered(cell: Cell, ending: Sequence[LocalOptimum]) -> list[LocalOptimum]:
    """Distinct optima, best first, with how many ended in each."""
    optima: list[LocalOptimum] = []
    for end in sorted(ending, key=lambda optimum: -optimum.objective):
        q = np.concatenate(
            [cell.folded(i, part) for i, part in enumerate(cell.system.split(end.q))]
        )
        # Best first: those of the same objective stand last.
        for j in range(len(optima) - 1, -1, -1):
            known = optima[j]
            if known.objective - end.objective >= SAME_OBJECTIVE:
                optima.append(LocalOptimum(q, end.objective, 1))
                break
            if cell.distances(known.q[None], q)[0] < _SAME_JOINTS:
                optima[j] = replace(known, count=known.count + 1)
                break
        else:
            optima.append(LocalOptimum(q, end.objective, 1))
    return _tie_broken(optima)


def _tie_broken(optima: list[LocalOptimum]) -> list[LocalOptimum]:
    """With the first of the best in the order of joints first, so that no seed decides."""
    if not optima:
        return optima
    best = optima[0].objective
    tied = [o for o in optima if o.objective >= best - _TIE * max(1.0, abs(best))]
    rest = optima[len(tied) :]
    first = list(tied)
    for joint in range(len(tied[0].q)):
        least = min(o.q[joint] for o in first)
        first = [o for o in first if o.q[joint] <= least + _SAME_JOINTS]
    return [first[0], *(o for o in tied if o is not first[0]), *rest]
