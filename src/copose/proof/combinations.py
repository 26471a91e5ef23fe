"""Search over combinations of segments: none is worth more than the best known by more than ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count, product

import numpy as np

from copose.poses import Array, Indices
from copose.progress import heed, stage
from copose.proof.segments import MotionSegments


@dataclass(frozen=True)
class CombinationSearchOptions:
    """Numbers of the search over combinations."""

    at_once: int = 16384  # combinations that are bounded together
    most: int = 20_000_000  # combinations that are kept, at most
    roots: int = 64  # runs of segments of an arm with which it begins, at most
    stuck: int = 4  # halvings of every arm's segments in which the gap has to shrink by a fifth
    tried: int = 256  # combinations whose middles are evaluated, of those with the highest bounds
    # By which every bound is raised: what rounding its last steps, log det of sums, may lose.
    rounding: float = 1e-10


class CombinationSearch:
    """Branch and bound over combinations of the arms' segments.

    Attributes:
        best: value of the best posture known.
        highest: no combination is worth more; ∞ before the first bound of all.
        combinations: how many were bounded.
        last: of segments, by their numbers, (count, arms), those that were bounded last.
    """

    def __init__(
        self,
        arms: Sequence[MotionSegments],
        bounds: Callable[[Array], Array],
        best: float,
        epsilon: float,
        options: CombinationSearchOptions = CombinationSearchOptions(),
    ) -> None:
        """A search over segments, with bounds of cells by their corners, see `upper_bounds`."""
        self._arms, self._bounds, self._options = arms, bounds, options
        self._runs = [_runs(arm, options.roots) for arm in arms]
        self.best, self._epsilon = best, epsilon
        self.highest, self._ruled_out, self.combinations = np.inf, -np.inf, 0
        self.last = np.zeros((0, len(arms)), dtype=np.intp)

    def run(self, better: Callable[[Sequence[Array]], float | None]) -> bool:
        """Rule out every combination; False where too many are left, or rounding is in the way.

        Runs of segments are halved first, those of the arm with the longest, then segments.

        Args:
            better: polishes the best of postures, by arm (count, n_i), and returns its value if it
                is better than the best.
        """
        options, arms, gaps = self._options, self._arms, list[float]()
        numbers = np.meshgrid(*(np.arange(b.shape[-1]) for b in self._cells), indexing="ij")
        chosen = np.stack([each.ravel() for each in numbers], axis=1)
        for turn in count():
            if len(chosen) > options.most or any(arm.lost for arm in arms):
                break
            if not any(self._runs):
                self.last = chosen
            chosen, values = self._kept(chosen)
            self.highest = max(self._ruled_out, float(values.max(initial=-np.inf)))
            gap = self.highest - self.best
            stage(f"proving, {len(values):,} combinations left, gap {gap:.1e}")
            if not len(chosen):
                return True
            depths = [len(runs) for runs in self._runs]
            if any(depths):
                chosen = self._halved(chosen, int(np.argmax(depths)))
                continue
            before = gaps[: -options.stuck * len(arms)][-1:]
            if before and not gap < 0.8 * before[0]:
                break
            gaps.append(gap)
            most = chosen[np.argsort(-values, kind="stable")[: options.tried]]
            value = better([arm.middles(arm.ends[rows])[0]
                            for arm, rows in zip(arms, most.T, strict=True)])  # fmt: skip
            self.best = self.best if value is None else max(self.best, value)
            chosen = self._halved(chosen, turn % len(arms))
        return False

    @property
    def _cells(self) -> list[Array]:
        """Bounds of each arm's runs of segments, or segments, (sides, 1 or 2, a, a, count)."""
        both = zip(self._runs, self._arms, strict=True)
        return [runs[-1] if runs else arm.bounds for runs, arm in both]

    def _kept(self, chosen: Indices) -> tuple[Indices, Array]:
        """Combinations that their bounds do not rule out, and the bounds, ∞ where there is none."""
        values, size = np.empty(len(chosen)), self._options.at_once
        for first in range(0, len(chosen), size):
            heed()
            rows = chosen[first : first + size].T
            ends = [b[..., k].swapaxes(0, 1) for b, k in zip(self._cells, rows, strict=True)]
            corners = np.stack([sum(corner) for corner in product(*ends)])
            values[first : first + size] = self._bounds(corners)
        self.combinations += len(chosen)
        values = np.where(np.isnan(values), np.inf, values)
        values += self._options.rounding * np.maximum(1.0, np.abs(values))
        keep = values > self.best + self._epsilon
        self._ruled_out = max(self._ruled_out, float(values[~keep].max(initial=-np.inf)))
        return chosen[keep], values[keep]

    def _halved(self, chosen: Indices, k: int) -> Indices:
        """The combinations with the runs, or segments, of arm k halved."""
        own, which = np.unique(chosen[:, k], return_inverse=True)
        if self._runs[k]:
            self._runs[k].pop()
            halves = 2 * own[:, None] + [0, 1]
            there = halves < self._cells[k].shape[-1]
            flat, parts = halves[there], there.sum(axis=1)
        else:
            flat, parts = self._arms[k].halved(own)
        rows = np.repeat(np.arange(len(chosen)), parts[which])
        place = np.arange(len(rows)) - np.searchsorted(rows, rows)
        chosen = chosen[rows]
        chosen[:, k] = flat[(np.cumsum(parts) - parts)[which[rows]] + place]
        return chosen


def _runs(arm: MotionSegments, most: int) -> list[Array]:
    """Bounds of runs of 2, 4, … segments in order, until there are few: multiples of the mean that
    are below all of a run's, or above, (sides, 1, a, a, count).
    """
    levels, bounds = list[Array](), arm.bounds
    while (size := bounds.shape[-1]) > most:
        second = bounds[..., np.minimum(np.arange(1, size + 1, 2), size - 1)]
        both = np.concatenate([bounds[..., ::2], second], axis=1)
        bounds = np.stack([_multiple(x, up) for x, (_, up) in zip(both, arm.sides, strict=True)])
        levels.append(bounds)
    return levels


def _multiple(bounds: Array, upper: bool) -> Array:
    """Multiples of the means of k matrices that bound all k, (k, a, a, count) to
    (1, a, a, count).
    """
    mean = bounds.mean(axis=0)
    values, vectors = np.linalg.eigh(np.moveaxis(mean, -1, 0))
    fine = values[:, 0] > 0
    root = vectors / np.sqrt(np.where(fine[:, None], values, 1.0))[:, None]
    turned = np.linalg.eigvalsh(root.swapaxes(1, 2) @ np.moveaxis(bounds, -1, 1) @ root)
    # Rounding: bounds of runs need not be tight.
    if upper:
        factor = np.where(fine, turned[..., -1].max(axis=0) * (1 + 1e-6), 1e100)
    else:
        factor = np.where(fine, np.maximum(turned[..., 0].min(axis=0) - 1e-6, 0.0), 0.0)
    return np.asarray((mean * factor)[None])
