"""Numbers as words, and round numbers."""

from __future__ import annotations

import math


def six(value: float | None) -> str:
    """Six decimal places; – where there is no number."""
    return "–" if value is None else f"{value:.6f}"


def three(value: float | None) -> str:
    """Three digits, as a decimal number where six places do; – where there is no number."""
    if value is None:
        return "–"
    rounded = float(f"{round(value, 9):.3g}") + 0.0
    if not 1e-3 <= abs(rounded) < 1e6:
        return f"{rounded:g}"
    return f"{rounded:.{max(0, 2 - math.floor(math.log10(abs(rounded))))}f}"


def percent(share: float) -> str:
    """A share in percent, without the sign."""
    return f"{100 * share:.1f}"


def round_scale(length: float) -> float:
    """The largest of 1, 2, 5 × 10^k not above a positive length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-12))
