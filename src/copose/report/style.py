"""Colours, words and scales that all pictures share.

Colours are Okabe and Ito's, which people with colour-blindness tell apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from copose.problem import SPACES
from copose.results import Posture, Solution

SYSTEM = "#D55E00"
ANGULAR = "#8B3A8B"
ARMS = ("#0072B2", "#009E73", "#E69F00", "#56B4E9", "#666666", "#CC79A7", "#999933", "#332288")
OBJECT = "#BBBBBB"
INK = "#222222"
BEFORE = "#9A9A9A"

RC: Any = {
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "font.family": "sans-serif",
    "svg.hashsalt": "copose",
    "svg.fonttype": "none",
    # Names are not formulas.
    "text.parse_math": False,
}

# A tip farther than this from its grasp, m or rad, does not hold the object.
OPEN = 1e-6

LINEAR_UNIT = "m/s² per N·m"
ANGULAR_UNIT = "rad/s² per N·m"


def panels(solution: Solution) -> list[tuple[str, Posture]]:
    """The postures to draw, with what they are called."""
    if solution.before is None and solution.after is not None:
        return [("posture", solution.after)]
    named = (("before", solution.before), ("after", solution.after))
    found = [(name, posture) for name, posture in named if posture is not None]
    if solution.nearest_miss is not None:
        found.append(("nearest miss", solution.nearest_miss))
    return found


def measure_word(space: str) -> str:
    """What the content of an ellipsoid in a space is called."""
    return "area" if SPACES[space].m == 2 else "volume"


def heading(solution: Solution) -> str:
    """What stands above a picture: the problem's name and the gain in words."""
    return ": ".join(
        part for part in (short(solution.problem.name, 60), gain_words(solution)) if part
    )


def short(name: str, most: int = 20) -> str:
    """A name that fits into a picture."""
    return name if len(name) <= most else name[: most - 1] + "…"


def keys(arms: Iterable[str], *more: str) -> list[str]:
    """The entries of a picture's legend."""
    return [f"arm {short(name)}" for name in arms] + list(more)


def legend_grid(entries: list[str], inches: float) -> tuple[int, int]:
    """Columns and rows in which a legend's entries fit into so many inches."""
    # A letter takes about a twelfth of an inch at the size that legends are set in.
    widest = max(0.6 + len(entry) / 12 for entry in entries)
    columns = max(1, min(len(entries), int(inches / widest)))
    return columns, -(-len(entries) // columns)


def gain_words(solution: Solution) -> str:
    """A gain in plain words: ``volume ×2.3``; empty where there is none to tell."""
    if solution.gain is None:
        return ""
    ratio = math.exp(solution.gain) if solution.gain < 600 else math.inf
    return f"{measure_word(solution.problem.space)} ×{ratio:.3g}"


def numbers(values: tuple[float, ...]) -> str:
    """Three digits each."""
    return ", ".join(f"{value:.3g}" for value in values)


def round_scale(length: float) -> float:
    """The largest of 1, 2, 5 × 10^k not above a positive length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-12))
