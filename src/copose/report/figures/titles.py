"""What stands above the panels of a picture."""

from __future__ import annotations

from copose.problem import SPACES
from copose.report import style
from copose.report.style import Panel
from copose.results import Posture


def title(panel: Panel) -> str:
    """What a panel shows, and in a line of its own each what is nearest and what is to be said."""
    posture, solution = panel.posture, panel.solution
    if panel.name == style.MISS:
        unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
        return f"{panel.name}: gap {max(posture.closure_error.values()):.3g} {unit}"
    lines = [
        f"{panel.name}: {style.value_words(solution, posture)}",
        distance_words(posture),
        panel.note,
    ]
    return "\n".join(filter(None, lines))


def distance_words(posture: Posture, most: int = 40) -> str:
    """The smallest distance and what it is between; empty where it is not known."""
    if posture.collision is None:
        return ""
    pair = " – ".join(style.short(name, most) for name in posture.collision.pair)
    return f"nearest: {style.three(posture.collision.distance)} m, {pair}"
