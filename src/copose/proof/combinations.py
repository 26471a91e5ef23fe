"""Search over combinations of segments: none is worth more than the best known by more than ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from copose.capability.sums import matrices
from copose.poses import Array, Indices
from copose.progress import heed, stage
from copose.proof.segments import MotionSegments


@dataclass(frozen=True)
class CombinationSearchOptions:
    """Numbers of the search over combinations."""

    at_once: int = 16384  # combinations that are bounded together
    roots: int = 64  # runs of segments of an arm with which it begins, at most
    most: int = 20_000_000  # combinations that are kept, at most
    halvings: int = 60
    stuck: int = 4  # halvings in which the gap has to shrink by a fifth
    split: float = 0.3  # part of the loosest bound of a combination at which an arm is halved too
    tried: int = 256  # combinations whose middles are evaluated, of those with the highest bounds
    # By which every bound is raised: what rounding its last steps, log det of sums, may lose.
    rounding: float = 1e-10


class CombinationSearch:
    """Branch and bound over combinations of the arms' segments.

    Attributes:
        best: value of the best posture known.
        highest: no combination is worth more; ∞ before the first bound of all.
        combinations: how many were bounded.
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
        self.best, self._epsilon = best, epsilon
        self.highest, self._ruled_out, self.combinations = np.inf, -np.inf, 0

    def run(self, better: Callable[[Sequence[Array]], float | None]) -> bool:
        """Rule out every combination; False where too many are left, or rounding is in the way.

        Args:
            better: polishes the best of postures, by arm (count, n_i), and returns its value if it
                is better than the best.
        """
        options, gaps = self._options, list[float]()
        chosen = self._descended()
        for _ in range(options.halvings):
            if len(chosen) > options.most:
                return False
            chosen, values = self._kept([arm.bounds for arm in self._arms], chosen)
            self.highest = max(self._ruled_out, float(values.max(initial=-np.inf)))
            gaps.append(self.highest - self.best)
            stage(f"proving, {len(values):,} combinations left, gap {gaps[-1]:.1e}")
            if not len(chosen):
                return True
            if len(gaps) > options.stuck and gaps[-1] > 0.8 * gaps[-1 - options.stuck]:
                return False
            most = chosen[np.argsort(-values, kind="stable")[: options.tried]]
            value = better([arm.middles(arm.ends[rows])[0]
                            for arm, rows in zip(self._arms, most.T, strict=True)])  # fmt: skip
            self.best = self.best if value is None else max(self.best, value)
            chosen = self._halved(chosen)
        return False

    def _descended(self) -> Indices:
        """Combinations of segments that those of whole runs of them do not rule out."""
        trees = [_runs(arm, self._options.roots) for arm in self._arms]
        depths = [len(tree) - 1 for tree in trees]
        grids = np.meshgrid(*(np.arange(tree[-1].shape[3]) for tree in trees), indexing="ij")
        chosen = np.stack([grid.ravel() for grid in grids], axis=1)
        while any(depths):
            stage(f"proving, {len(chosen):,} combinations of runs of segments")
            levels = [tree[depth] for tree, depth in zip(trees, depths, strict=True)]
            chosen, _ = self._kept(levels, chosen)
            k = int(np.argmax(depths))
            depths[k] -= 1
            chosen = np.repeat(chosen, 2, axis=0)
            chosen[:, k] = 2 * chosen[:, k] + np.arange(len(chosen)) % 2
            chosen = chosen[chosen[:, k] < trees[k][depths[k]].shape[3]]
            if len(chosen) > self._options.most:
                break
        return chosen

    def _kept(self, bounds: Sequence[Array], chosen: Indices) -> tuple[Indices, Array]:
        """Combinations that their bounds do not rule out, and the bounds, ∞ where there is none."""
        values, size = np.empty(len(chosen)), self._options.at_once
        for first in range(0, len(chosen), size):
            heed()
            rows = chosen[first : first + size].T
            ends = [b[..., k] for b, k in zip(bounds, rows, strict=True)]
            codes = product(*(range(end.shape[1]) for end in ends))
            corners = [sum(end[:, v] for end, v in zip(ends, code, strict=True)) for code in codes]
            values[first : first + size] = self._bounds(np.stack(corners))
        self.combinations += len(chosen)
        values = np.where(np.isnan(values), np.inf, values)
        values += self._options.rounding * np.maximum(1.0, np.abs(values))
        keep = values > self.best + self._epsilon
        self._ruled_out = max(self._ruled_out, float(values[~keep].max(initial=-np.inf)))
        return chosen[keep], values[keep]

    def _halved(self, chosen: Indices) -> Indices:
        """Combinations with the segments halved whose bounds are loosest."""
        loose = np.stack(
            [arm.loose[k] for arm, k in zip(self._arms, chosen.T, strict=True)], axis=1
        )
        split = loose >= self._options.split * loose.max(axis=1, keepdims=True)
        for k, arm in enumerate(self._arms):
            own, which = np.unique(chosen[split[:, k], k], return_inverse=True)
            flat, parts = arm.halved(own)
            counts, first = np.ones((2, len(chosen)), dtype=np.intp)
            counts[split[:, k]] = parts[which]
            first[split[:, k]] = (np.cumsum(parts) - parts)[which]
            rows = np.repeat(np.arange(len(chosen)), counts)
            number = first[rows] + np.arange(len(rows)) - (np.cumsum(counts) - counts)[rows]
            chosen, split = chosen[rows], split[rows]
            chosen[split[:, k], k] = flat[number[split[:, k]]]
        return chosen


def _runs(arm: MotionSegments, roots: int) -> list[Array]:
    """Bounds of runs of 1, 2, 4, … segments in order, until there are few: multiples of the mean
    that are below all of a run's, or above, (sides, 1, s, count).
    """
    levels, bounds = list[Array](), arm.bounds
    while not levels or levels[-1].shape[3] > roots:
        levels.append(
            np.stack([_multiple(x, up) for x, (_, up) in zip(bounds, arm.sides, strict=True)])
        )
        last = levels[-1]
        last = np.concatenate([last, last[..., -1:]], axis=3)[..., : -(-last.shape[3] // 2) * 2]
        bounds = np.concatenate([last[..., ::2], last[..., 1::2]], axis=1)
    return levels


def _multiple(bounds: Array, upper: bool) -> Array:
    """Multiples of the means of k matrices that bound all k, (k, s, count) to (1, s, count)."""
    mean = bounds.mean(axis=0)
    values, vectors = np.linalg.eigh(matrices(mean))
    fine = values[:, 0] > 0
    root = vectors / np.sqrt(np.where(fine[:, None], values, 1.0))[:, None]
    turned = [np.linalg.eigvalsh(root.swapaxes(1, 2) @ matrices(x) @ root) for x in bounds]
    # Rounding: bounds of runs need not be tight.
    if upper:
        factor = np.where(fine, np.max(turned, axis=0)[:, -1] * (1 + 1e-6), 1e100)
    else:
        factor = np.where(fine, np.maximum(np.min(turned, axis=0)[:, 0] - 1e-6, 0.0), 0.0)
    return np.asarray((mean * factor)[None])
