"""Capsules around a box, in closed form: parallel rods over its whole length."""

from __future__ import annotations

from itertools import product

import numpy as np

from copose.collision.capsules import MOST, Capsule
from copose.poses import Array, frozen_array

# What capsules are larger than they have to be, m.
_ROUNDING = 1e-9
_MOST_RODS = 1_000_000


def around_box(size: tuple[float, ...], most: float = MOST) -> tuple[Capsule, ...]:
    """Capsules that together contain a box by its edges, or in the plane z = 0 a rectangle.

    The box is cut along its longest edge into equal rods, as few as may be, each in a capsule that
    sticks out of the box by at most ``most``. Where there are rods inside, these may stick out of
    what they fill by more, for others lie around them: so the outermost layer is laid, then what it
    leaves is covered anew.
    """
    edges = np.array([*size, 0.0][:3])
    long = int(np.argmax(edges))
    across = [k for k in range(3) if k != long]
    found = []
    for middle, half, radius in _rods(edges[across], edges[long], most, most, len(size) == 2):
        a = np.zeros(3)
        a[across], b = middle, np.zeros(3)
        b[across] = middle
        a[long], b[long] = -half, half
        found.append(Capsule(frozen_array(a), frozen_array(b), radius + _ROUNDING))
    return tuple(found)


def _rods(
    across: Array, length: float, beside: float, beyond: float, flat: bool
) -> list[tuple[Array, float, float]]:
    """Middle in the cross-section, half length and radius of each capsule.

    Args:
        across: the edges of the cross-section, (2,); of a rectangle the second is 0.
        length: the longest edge.
        beside: how far capsules may stick out beside the box; ``beyond`` beyond its ends.
        beyond: see ``beside``.
        flat: whether it is a rectangle.
    """
    fits = (
        ((columns, count // columns), _capsule(across / (columns, count // columns), *rest))
        for rest in [(length, beside, beyond)]
        for count in range(1, _MOST_RODS)
        for columns in ([count] if flat else _divisors(count))
    )
    (columns, rows), (half, radius) = next((n, c) for n, c in fits if c is not None)
    tile = across / (columns, rows)
    inside = columns > 2 and rows > 2
    rods = [
        (tile * (i - (columns - 1) / 2, j - (rows - 1) / 2), half, radius)
        for i, j in product(range(columns), range(rows))
        if not inside or i in (0, columns - 1) or j in (0, rows - 1)
    ]
    if inside:
        rods += _rods(across - 2 * tile, length, beside + float(tile.min()), beyond, flat)
    return rods


def _divisors(count: int) -> list[int]:
    return [n for n in range(1, count + 1) if count % n == 0]


def _capsule(
    tile: Array, length: float, beside: float, beyond: float
) -> tuple[float, float] | None:
    """Half length and radius of the capsule around a rod, None where it sticks out too far.

    Radius r and the length e by which its segment ends before the rod does: r² = c² + e² for the
    rod to be inside, with c half the diagonal of the cross-section; it sticks out by r − e beyond
    the ends and by r − w/2 beside the narrower edge w.
    """
    corner = float(tile @ tile) / 4
    narrow = min(tile[tile > 0], default=0.0)
    # The shortest inset whose cap does not stick out: r − e ≤ beyond.
    inset = max(0.0, (corner - beyond**2) / (2 * beyond))
    inset = min(inset, length / 2)
    radius = float(np.sqrt(corner + inset**2))
    if radius - inset > beyond + _ROUNDING or radius - narrow / 2 > beside:
        return None
    return length / 2 - inset, radius
