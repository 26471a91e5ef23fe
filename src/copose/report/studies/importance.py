"""How much each key counts: first-order shares of the variance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices


@dataclass(frozen=True)
class BinOptions:
    """How a key is cut into bins."""

    most: int = 12  # bins of a key with many different values
    points: int = 12  # that a bin has at least, of a key with many different values


def first_order_share(along: Array, values: Array, options: BinOptions = BinOptions()) -> float:
    """The share of the variance of some values that a key alone explains, from 0 to 1.

    It is the first-order index S = Var(E[value | key]) / Var(value), estimated by bins of the key
    as ε² = (SS_between − (bins − 1) · MS_within) / SS_total, which is 0 on average where the key
    does not count; negative estimates are 0. What keys do only together is in none of their shares,
    so that these need not add up to 1.

    Args:
        along: the key at each point, (count,).
        values: finite, (count,).
        options: how the key is cut into bins of about equal counts; few values are a bin each.
    """
    count = len(values)
    total = float(((values - values.mean()) ** 2).sum()) if count else 0.0
    bins = _bins(along, options)
    number = int(bins.max(initial=-1)) + 1
    if number < 2 or count <= number or total <= 1e-24 * count * float((values**2).max()):
        return 0.0
    counts = np.bincount(bins, minlength=number)
    means = np.bincount(bins, values, number) / counts
    between = float((counts * (means - values.mean()) ** 2).sum())
    within = (total - between) / (count - number)
    return min(max((between - (number - 1) * within) / total, 0.0), 1.0)


def _bins(along: Array, options: BinOptions) -> Indices:
    """The number of the bin of each point, without empty bins."""
    different = np.unique(along)
    most = max(2, min(options.most, len(along) // options.points))
    if len(different) > most:
        edges = np.quantile(along, np.linspace(0, 1, most + 1)[1:-1])
        along = np.searchsorted(np.unique(edges), along, side="right").astype(float)
    bins: Indices = np.unique(along, return_inverse=True)[1]
    return bins
