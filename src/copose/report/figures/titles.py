"""Titles of the panels of a picture."""

from __future__ import annotations

from copose.problem import SPACES
from copose.report.panels import Panel
from copose.report.words import short, three, value_words
from copose.results import Posture, Solution


def title(panel: Panel) -> str:
    """A panel's name and value; in a line of its own each the nearest bodies and the note."""
    posture, solution = panel.posture, panel.solution
    if panel.misses:
        unit = "m or rad" if SPACES[solution.problem.space].rigid else "m"
        return f"{panel.name}: gap {max(posture.closure_error.values()):.3g} {unit}"
    lines = [f"{panel.name}: {value_words(solution, posture)}", distance_words(posture), panel.note]
    return "\n".join(filter(None, lines))


def distance_words(posture: Posture, most: int = 40) -> str:
    """The smallest distance and the two bodies that it is between; empty where it is not known."""
    if posture.collision is None:
        return ""
    pair = " – ".join(short(name, most) for name in posture.collision.pair)
    return f"nearest: {three(posture.collision.distance)} m, {pair}"


def moved_words(solution: Solution, *, most: int = 4, least: float = 0.01) -> str:
    """The joints that differ most between before and after, by at least so much, and by how much,
    rad or m; empty where there is none.
    """
    before, after = solution.before, solution.after
    if before is None or after is None:
        return ""
    moves = [
        (new - old, f"{short(arm)} {short(name, 30)}")
        for arm, names in solution.joint_names.items()
        for name, old, new in zip(names, before.joints[arm], after.joints[arm], strict=True)
    ]
    largest = sorted(moves, key=lambda move: -abs(move[0]))[:most]
    named = [f"{name} {move:+.2f}" for move, name in largest if abs(move) >= least]
    return f"moved most, rad or m: {', '.join(named)}" if named else ""
