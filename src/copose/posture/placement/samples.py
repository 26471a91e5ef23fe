"""Samples of the free coordinates: scattered over the ranges, near a placement, and closed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from copose.cell.cell import Cell
from copose.cell.variables import Places
from copose.low_discrepancy import points
from copose.poses import Array
from copose.posture.placement.placed import FreePoses
from copose.robots import finite_range


class PlacementSampler:
    """Draws placements: values of the free coordinates of all cases."""

    _cornered = 6  # free coordinates at most of which all corners are tried

    def __init__(self, places: Places, cases: Sequence[Cell], seed: int) -> None:
        """A sampler of what is free, for the cell in every case."""
        self._places, self._cases, self._seed = places, cases, seed
        self._freedom = places.freedom

    @property
    def nominal(self) -> FreePoses:
        """The file's placement, clipped into the ranges, and held by fixed arms."""
        xs = self.everywhere(self._freedom.nominal)
        return next(self.held(xs), xs)

    def everywhere(self, x: Array) -> FreePoses:
        """The same free coordinates, (d,), in every case."""
        return (x,) * len(self._cases)

    def scattered(self, count: int, turn: int) -> Array:
        """Points evenly scattered over the ranges, (count, d); ``turn`` tells such sets apart."""
        low, high = self._freedom.lower, self._freedom.upper
        rng = np.random.default_rng([self._seed, 8, turn])
        return np.asarray(low + points(count, len(low), rng) * (high - low))

    @property
    def grid(self) -> Array:
        """Centre, face centres and corners of the ranges, (count, d): optima like to lie there."""
        d, halves = len(self._freedom), np.eye(len(self._freedom)) / 2
        every = [np.full((1, d), 0.5), 0.5 - halves, 0.5 + halves]
        if 1 < d <= self._cornered:
            every.append(np.array(list(product((0.0, 1.0), repeat=d))))
        low, high = self._freedom.lower, self._freedom.upper
        share = np.vstack(every)
        return np.asarray((1 - share) * low + share * high)

    def around(self, xs: FreePoses, count: int, near: float, turn: int) -> Iterator[FreePoses]:
        """Placements drawn around one, within this share of the ranges."""
        if not len(self._freedom):
            return
        rng = np.random.default_rng([self._seed, 9, turn])
        low, high = self._freedom.lower, self._freedom.upper
        for step in rng.uniform(-near, near, (count, len(low))):
            yield from self.held(tuple(np.clip(x + step * (high - low), low, high) for x in xs))

    def held(self, xs: FreePoses) -> Iterator[FreePoses]:
        """A placement, moved to where fixed arms hold the object; nothing where they cannot."""
        if not any(arm.fixed for arm in self._cases[0].arms) or not len(self._freedom):
            yield xs
            return
        moved = self._places.held_by_fixed(self._cases, xs)
        if moved is not None:
            yield moved

    def closed(self, x: Array, rng: np.random.Generator) -> Iterator[FreePoses]:
        """A placement near x, (d,), at which random postures of all arms close, in every case."""
        from scipy.optimize import least_squares

        cells, places = self._cases, self._places
        closing = places.closing
        low, high = (
            np.concatenate([np.tile(np.concatenate(ends), len(cells)), free])
            for ends, free in zip(
                zip(*(finite_range(*limits) for limits in
                      zip(cells[0].lower, cells[0].upper, strict=True)), strict=True),
                places.bounds, strict=True,
            )
        )  # fmt: skip
        given = np.concatenate([self._freedom.numbers(cell) for cell in cells])
        start = rng.uniform(low, high)
        start[len(start) - places.size :] = places.joined([x] * len(cells))
        # Joints that do not move at all are no variables.
        moves = high > low
        whole = np.where(moves, start, low)

        def completed(variables: Array) -> Array:
            whole[moves] = variables
            return whole

        def residual(variables: Array) -> Array:
            return np.array(closing(completed(variables), given)[0]).ravel()

        def slope(variables: Array) -> Array:
            return np.array(closing(completed(variables), given)[1])[:, moves]

        end = least_squares(
            residual,
            np.clip(start[moves], low[moves] + 1e-9, high[moves] - 1e-9),
            jac=slope,
            bounds=(low[moves], high[moves]), max_nfev=60, xtol=1e-14, ftol=1e-14, gtol=1e-14,
        )  # fmt: skip
        if np.sqrt(2 * end.cost) <= 1e-6:
            moved = places.parted(completed(end.x)[len(start) - places.size :])
            yield from self.held(tuple(moved))
