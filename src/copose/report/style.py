"""Colours, words and scales that all pictures share.

Colours are Okabe and Ito's, which people with colour-blindness tell apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

from copose.problem import OBJECTIVE_TABLES
from copose.results import CasePosture, Motion, Posture, ProblemRecord, Solution

Answer: TypeAlias = Solution | Motion


class Drawn(Protocol):
    """What a scene is of: a result, or a problem that has none yet."""

    @property
    def problem(self) -> ProblemRecord:
        """The object's shape, and what stands around."""
        ...


SYSTEM = "#D55E00"
ANGULAR = "#8B3A8B"
ARMS = ("#0072B2", "#009E73", "#E69F00", "#56B4E9", "#666666", "#CC79A7", "#999933", "#332288")
MISS = "nearest miss"
NOWHERE = "no posture closes at the file's pose"
OBJECT = "#BBBBBB"
INK = "#222222"
BEFORE = "#9A9A9A"
EXACT = "#5F7F9F"
OVER = "#C00000"
OBSTACLE = "#6E6E6E"

# Of a frame's axes x, y, z.
AXES = ("#D55E00", "#009E73", "#0072B2")

# Lines of what may be moved, within its range.
DASHES = (0, (2.2, 1.3))

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

# Which world axis a task coordinate is along, or about.
LINEAR_AXES = {"x": 0, "y": 1, "z": 2}
ANGULAR_AXES = {"roll": 0, "pitch": 1, "yaw": 2, "angle": 2}

# Kinds of objectives that torque limits decide.
LIMITED = tuple(kind for kind, table in OBJECTIVE_TABLES.items() if table.torque_limited)

# A tip farther than this from its grasp, m or rad, does not hold the object.
OPEN = 1e-6


def units(solution: Answer) -> tuple[str, str]:
    """Units of linear and of angular semi-axes: per unit torque, or at the torque limits."""
    per = "" if solution.problem.torque_scaling == "limits" else " per N·m"
    return f"m/s²{per}", f"rad/s²{per}"


def plain_unit(names: Iterable[str]) -> str:
    """The unit of accelerations along some coordinates."""
    kinds = {name in ANGULAR_AXES for name in names}
    return ", ".join(("m/s²", "rad/s²")[kind] for kind in sorted(kinds))


@dataclass(frozen=True)
class Panel:
    """One posture of a picture.

    Attributes:
        name: what it is called.
        posture: what is drawn.
        solution: whose it is.
        other: a panel whose ellipsoid is drawn as an outline over this one's.
        note: what is to be said of it.
    """

    name: str
    posture: Posture
    solution: Solution
    other: Panel | None = None
    note: str = ""


def scales(panels: list[Panel], longest: list[float], length: float) -> list[float] | None:
    """Metres drawn per unit of acceleration, by panel: one scale for all that share a unit.

    Args:
        panels: what is drawn.
        longest: the longest semi-axis of each, 0 where there is none.
        length: that the longest of all is drawn, m.

    Returns:
        None where there is nothing to draw.
    """
    if not any(longest):
        return None
    found = []
    for panel in panels:
        alike = [
            radius
            for radius, other in zip(longest, panels, strict=True)
            if units(other.solution) == units(panel.solution)
        ]
        found.append(length / max(max(alike), 1e-300) if any(alike) else 1.0)
    return found


def panels(solution: Solution) -> list[Panel]:
    """The postures of a result, with what they are called."""
    if solution.before is None and solution.after is not None:
        name = now(solution)
        return [Panel(name, solution.after, solution, note=NOWHERE if name == "after" else "")]
    named = (
        ("before", solution.before),
        ("after", solution.after),
        (MISS, solution.nearest_miss),
    )
    return [Panel(name, posture, solution) for name, posture in named if posture is not None]


def compared(solution: Solution) -> bool:
    """Whether a result has a before."""
    return solution.before is not None or bool(solution.cases_before)


def now(solution: Solution) -> str:
    """What a result's answer is called: one that was neither searched nor moved is a posture."""
    placed = solution.search is not None and (solution.freedom or solution.cases)
    return "after" if compared(solution) or placed else "posture"


def stages(solution: Solution) -> tuple[str, ...]:
    """What the columns of a result's tables are called."""
    return ("before",) * compared(solution) + (now(solution),)


def measure_word(solution: Answer) -> str:
    """What the content of a result's ellipsoid is called."""
    return {1: "length", 2: "area"}.get(len(solution.problem.axes), "volume")


def objective_name(solution: Answer) -> str:
    """What the value of a result's objective is called."""
    kind = solution.objective.kind
    return {
        "volume": "log-volume",
        "velocity-volume": "velocity log-volume",
        "force-volume": "force log-volume",
        "all-round": "acceleration all round",
    }.get(kind, kind)


def objective_unit(solution: Answer) -> str:
    """The unit of a result's objective; empty of logarithms and ratios."""
    unit = solution.objective.unit
    return "" if unit in ("1", "log") else unit


def value_words(solution: Solution, posture: Posture) -> str:
    """A posture's objective where it is not the volume, else its log-volume."""
    objective = solution.objective
    value = objective.before if posture is solution.before else objective.after
    if isinstance(posture, CasePosture):
        value = posture.objective
    if value is None and objective.kind in LIMITED:
        return f"no {objective_name(solution)}"
    if objective.kind == "volume" or value is None:
        volume = posture.ellipsoid.log_volume
        return f"{measure_word(solution)} 0" if volume is None else f"log-volume {volume:.3f}"
    return f"{objective_name(solution)} {value:.4g} {objective_unit(solution)}".rstrip()


def largest_share(shares: dict[str, tuple[float, ...]]) -> float:
    """Of the joints' torque limits, over all arms."""
    return max(max(mine) for mine in shares.values())


def percent(share: float) -> str:
    """A share without the sign."""
    return f"{100 * share:.1f}"


def arm_colors(posture: Posture) -> dict[str, str]:
    """A colour for every arm."""
    return dict(zip(posture.arms, ARMS * len(posture.arms), strict=False))


def heading(solution: Solution) -> str:
    """What stands above a picture: the problem's name and the gain in words."""
    return ": ".join(
        part for part in (short(solution.problem.name, 60), gain_words(solution)) if part
    )


def short(name: str, most: int = 20) -> str:
    """A name that fits into a picture."""
    return name if len(name) <= most else name[: most - 1] + "…"


def gain_words(solution: Solution) -> str:
    """A gain in plain words: ``volume ×2.3``; empty where there is none to tell."""
    found = gain(solution)
    weights = [case.weight for case in solution.cases or ()]
    mean = "average" if len(set(weights)) == 1 else "weighted average"
    over = f" on {mean} over {len(weights)} cases" if len(weights) > 1 else ""
    return f"{gain_word(solution)} {found}{over}" if found else ""


def gain_word(solution: Answer) -> str:
    """What it is that a gain is of."""
    volume = measure_word(solution)
    return {
        "volume": volume,
        "task-compatibility": "weighted acceleration",
        "worst-direction": "shortest semi-axis",
        "isotropy": "shortest / longest",
        "velocity-volume": f"velocity {volume}",
        "force-volume": f"force {volume}",
    }.get(solution.objective.kind, objective_name(solution))


def gain(solution: Solution) -> str:
    """A gain as a ratio, ``×2.3``; from 0 or a negative value as a difference, ``+59 m/s²``.

    With cases that of their weighted mean.
    """
    weight = sum(case.weight for case in solution.cases or ()) or 1.0
    objective = solution.objective
    if objective.before is None or objective.after is None:
        return ""
    return gain_between(solution, objective.before / weight, objective.after / weight)


def gain_between(solution: Answer, before: float | None, after: float | None) -> str:
    """The gain from one value of a result's objective to another; empty where one is missing."""
    if before is None or after is None:
        return ""
    if solution.objective.unit == "log":
        return f"×{math.exp(after - before) if after - before < 600 else math.inf:.3g}"
    if before > 0 and after > 0:
        return f"×{after / before:.3g}"
    return f"{after - before:+.3g} {objective_unit(solution)}".rstrip()


def six(value: float | None) -> str:
    """Six decimal places; – where there is no number."""
    return "–" if value is None else f"{value:.6f}"


def numbers(values: tuple[float, ...]) -> str:
    """Three digits each."""
    return ", ".join(f"{value:.3g}" for value in values)


def three(value: float | None) -> str:
    """Three digits, as a decimal number where six places do; – where there is no number."""
    if value is None:
        return "–"
    rounded = float(f"{round(value, 9):.3g}") + 0.0
    if not 1e-3 <= abs(rounded) < 1e6:
        return f"{rounded:g}"
    return f"{rounded:.{max(0, 2 - math.floor(math.log10(abs(rounded))))}f}"


def round_scale(length: float) -> float:
    """The largest of 1, 2, 5 × 10^k not above a positive length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-12))
