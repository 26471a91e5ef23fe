"""The points of a study: a grid over all that varies, or a sample of it, each with every seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from copose.poses import Array
from copose.studies.study_file import SampleSpec, StudyFile, Vary


@dataclass(frozen=True)
class Point:
    """A point of a study."""

    number: int  # from 0, in the study
    values: Mapping[str, Any]  # of the keys that vary
    seed: int  # of its search
    point_hash: bytes  # of all that decides its line


@dataclass(frozen=True)
class Axis:
    """An axis of a study: one key, or several that vary together."""

    keys: tuple[str, ...]  # as ``--set`` takes them
    # The values of every key, a row each; None of a range that is sampled.
    rows: Sequence[tuple[Any, ...]] | None
    lower: float = math.nan  # the least of a range; nan of listed values
    upper: float = math.nan  # the largest; alike

    @property
    def label(self) -> str:
        """The keys in a line."""
        return ", ".join(self.keys)

    @property
    def ranged(self) -> bool:
        """True where the file names the ends of a range."""
        return not math.isnan(self.lower)

    def numeric(self, key: str) -> bool:
        """True where all values of a key are numbers."""
        column = self.keys.index(key)
        return all(
            isinstance(row[column], (int, float)) and not isinstance(row[column], bool)
            for row in self.rows or ()
        )

    @property
    def numbers(self) -> Array | None:
        """Numbers that tell the rows apart, in their order: those of the first key, where all
        values of all keys are numbers and of several keys the first one's differ; None elsewhere.
        """
        rows = self.rows or ()
        if not rows or not all(map(self.numeric, self.keys)):
            return None
        numbers = np.array([row[0] for row in rows], dtype=float)
        alone = len(self.keys) == 1
        return numbers if alone or len(np.unique(numbers)) == len(rows) else None

    def row(self, share: float) -> tuple[Any, ...]:
        """The values at a share of the range, or of the list, 0 ≤ share < 1."""
        if self.rows is not None:
            return self.rows[min(int(share * len(self.rows)), len(self.rows) - 1)]
        largest = max(abs(self.lower), abs(self.upper))
        return (_rounded(self.lower + share * (self.upper - self.lower), largest),)

    @classmethod
    def of(cls, vary: Vary, *, sampled: bool) -> Axis:
        """The axis of a ``[[vary]]`` table."""
        if vary.values is not None:
            rows = vary.values if vary.keys is not None else tuple((v,) for v in vary.values)
            return cls(vary.names, rows)
        lower, upper = float(vary.lower or 0.0), float(vary.upper or 0.0)
        if sampled:
            return cls(vary.names, None, lower, upper)
        grid = np.linspace(lower, upper, vary.steps or 2).tolist()
        largest = max(abs(lower), abs(upper))
        return cls(vary.names, tuple((_rounded(x, largest),) for x in grid), lower, upper)


class Points:
    """The points of a study, by number from 0.

    Of a grid the last ``[[vary]]`` changes fastest, and the seed faster still.

    Attributes:
        axes: what varies, in the order of the file.
        seeds: of the search.
        sampled: whether the points are a sample and no grid.
    """

    def __init__(self, study: StudyFile) -> None:
        self.seeds, self._sample = study.seeds, study.sample
        self.sampled = study.sample is not None
        self.axes = tuple(Axis.of(vary, sampled=self.sampled) for vary in study.vary)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the grid, or the count of the sample."""
        if self._sample is not None:
            return (self._sample.count,)
        return tuple(len(axis.rows or ()) for axis in self.axes)

    def __len__(self) -> int:
        return math.prod(self.shape) * len(self.seeds)

    def values(self, point: int) -> dict[str, Any]:
        """The value of every key that varies at a point."""
        place = point // len(self.seeds)
        if self._sample is not None:
            shares = self._shares[place].tolist()
            rows = [axis.row(share) for axis, share in zip(self.axes, shares, strict=True)]
        else:
            indices = self.indices(point)
            rows = [(axis.rows or ())[i] for axis, i in zip(self.axes, indices, strict=True)]
        return {
            key: value
            for axis, row in zip(self.axes, rows, strict=True)
            for key, value in zip(axis.keys, row, strict=True)
        }

    def indices(self, point: int) -> tuple[int, ...]:
        """Where a point is in the grid, a number from 0 for each axis."""
        indices, place = list[int](), point // len(self.seeds)
        for size in reversed(self.shape):
            place, index = divmod(place, size)
            indices.append(index)
        return tuple(reversed(indices))

    def along(self, axis: int) -> Array:
        """Where all points without their seeds are along an axis: of a range that is sampled the
        value, else the number of the row; an entry for each, in the order of the points.
        """
        rows = self.axes[axis].rows
        if self._sample is None:
            inner = math.prod(self.shape[axis + 1 :])
            outer = math.prod(self.shape[:axis])
            return np.tile(np.repeat(np.arange(self.shape[axis], dtype=float), inner), outer)
        shares, lower, upper = self._shares[:, axis], self.axes[axis].lower, self.axes[axis].upper
        if rows is None:
            return lower + shares * (upper - lower)
        return np.minimum(np.floor(shares * len(rows)), len(rows) - 1)

    def seed(self, point: int) -> int:
        """The seed of the search at a point."""
        return self.seeds[point % len(self.seeds)]

    @cached_property
    def _shares(self) -> Array:
        """Places of a sample in the unit cube, (count, axes)."""
        return np.zeros((0, 0)) if self._sample is None else _sampled(self._sample, len(self.axes))


def _sampled(sample: SampleSpec, dimension: int) -> Array:
    """Points of the unit cube, (count, dimension)."""
    if sample.method == "random":
        return np.random.default_rng(sample.seed).random((sample.count, dimension))
    from scipy.stats import qmc

    generator = np.random.default_rng(sample.seed)
    if sample.method == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(dimension, seed=generator).random(sample.count))
    # A power of two is balanced; of others SciPy would warn.
    exponent = math.ceil(math.log2(sample.count))
    sobol = qmc.Sobol(dimension, seed=generator)
    return np.asarray(sobol.random_base2(exponent)[: sample.count])


def _rounded(value: float, largest: float) -> float:
    """A value of a range up to this size as a person would write it: without the last digits, which
    are rounding.
    """
    return round(value, 12 - math.ceil(math.log10(largest)))
