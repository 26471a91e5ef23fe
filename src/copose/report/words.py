"""Words and numbers of results, and the names of task coordinates."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

from copose.problem import OBJECTIVE_TABLES
from copose.results import CasePosture, Motion, Posture, SearchRecord, Solution


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


LINEAR_AXES = {"x": 0, "y": 1, "z": 2}
ANGULAR_AXES = {"roll": 0, "pitch": 1, "yaw": 2, "angle": 2}


def semi_axis_units(solution: Solution | Motion) -> tuple[str, str]:
    """Units of linear and of angular semi-axes: per unit torque, or at the torque limits."""
    per = "" if solution.problem.torque_scaling == "limits" else " per N·m"
    return f"m/s²{per}", f"rad/s²{per}"


def acceleration_unit(names: Iterable[str]) -> str:
    """The unit of accelerations along some coordinates."""
    kinds = {name in ANGULAR_AXES for name in names}
    return ", ".join(("m/s²", "rad/s²")[kind] for kind in sorted(kinds))


Answer: TypeAlias = Solution | Motion


@dataclass(frozen=True)
class ObjectiveWords:
    """Words for one kind of objective."""

    value: str  # name of its value
    # Name of the quantity whose ratio a gain is; ``{content}`` stands for length, area or volume.
    gain: str
    # Name of the number beside an ellipsoid that is the objective itself, if any; of several, such
    # as ``acceleration 2``, the least is.
    stated: str = ""


OBJECTIVE_WORDS = {
    "volume": ObjectiveWords("log-volume", "{content}"),
    "task-compatibility": ObjectiveWords("task-compatibility", "weighted acceleration"),
    "worst-direction": ObjectiveWords("worst-direction", "shortest semi-axis"),
    "isotropy": ObjectiveWords("isotropy", "shortest / longest"),
    "acceleration": ObjectiveWords("acceleration", "acceleration", "acceleration"),
    "payload": ObjectiveWords("payload", "payload", "payload"),
    "all-round": ObjectiveWords("acceleration all round", "acceleration all round",
                                "residual radius"),
    "velocity-volume": ObjectiveWords("velocity log-volume", "velocity {content}"),
    "force-volume": ObjectiveWords("force log-volume", "force {content}"),
}  # fmt: skip


def objective_words(solution: Answer) -> ObjectiveWords:
    """Words for the kind of a result's objective."""
    kind = solution.objective.kind
    return OBJECTIVE_WORDS.get(kind, ObjectiveWords(kind, kind))


def objective_name(solution: Answer) -> str:
    """The name of the value of a result's objective."""
    return objective_words(solution).value


def objective_unit(solution: Answer) -> str:
    """The unit of a result's objective; empty for logarithms and ratios."""
    unit = solution.objective.unit
    return "" if unit in ("1", "log") else unit


def titled_objective(solution: Answer) -> str:
    """The name of the value of a result's objective, with its unit."""
    return ", ".join(filter(None, (objective_name(solution), objective_unit(solution))))


def measure_word(solution: Answer) -> str:
    """The content of a result's ellipsoid: length, area or volume."""
    return {1: "length", 2: "area"}.get(len(solution.problem.axes), "volume")


def value_words(solution: Solution, posture: Posture) -> str:
    """A posture's objective, or its log-volume where the objective is not known."""
    objective = solution.objective
    value = objective.before if posture is solution.before else objective.after
    if isinstance(posture, CasePosture):
        value = posture.objective
    if value is None and OBJECTIVE_TABLES[solution.objective.kind].torque_limited:
        return f"no {objective_name(solution)}"
    if objective.kind == "volume" or value is None:
        volume = posture.ellipsoid.log_volume
        return f"{measure_word(solution)} 0" if volume is None else f"log-volume {volume:.3f}"
    return f"{objective_name(solution)} {value:.4g} {objective_unit(solution)}".rstrip()


def gain_word(solution: Answer) -> str:
    """The name of the quantity whose ratio a gain is."""
    return objective_words(solution).gain.format(content=measure_word(solution))


def gain_between(solution: Answer, before: float | None, after: float | None) -> str:
    """The gain from one value of a result's objective to another: a ratio, ``×2.3``; from 0 or a
    negative value a difference, ``+59 m/s²``; empty where a value is missing.
    """
    if before is None or after is None:
        return ""
    if solution.objective.unit == "log":
        return f"×{math.exp(after - before) if after - before < 600 else math.inf:.3g}"
    if before > 0 and after > 0:
        return f"×{after / before:.3g}"
    return f"{after - before:+.3g} {objective_unit(solution)}".rstrip()


def result_gain(solution: Solution) -> str:
    """The gain of a result, with cases that of their weighted mean; empty where there is none."""
    weight = sum(case.weight for case in solution.cases or ()) or 1.0
    objective = solution.objective
    if objective.before is None or objective.after is None:
        return ""
    return gain_between(solution, objective.before / weight, objective.after / weight)


def gain_words(solution: Solution) -> str:
    """A gain and the quantity that it is of: ``volume ×2.3``; empty where there is none."""
    gained = result_gain(solution)
    weights = [case.weight for case in solution.cases or ()]
    mean = "average" if len(set(weights)) == 1 else "weighted average"
    over = f" on {mean} over {len(weights)} cases" if len(weights) > 1 else ""
    return f"{gain_word(solution)} {gained}{over}" if gained else ""


def has_before(solution: Solution) -> bool:
    """True where a result has a posture from before."""
    return solution.before is not None or bool(solution.cases_before)


def answer_word(solution: Solution) -> str:
    """The name of a result's answer; one that was neither searched nor moved is a posture."""
    placed = solution.search is not None and (solution.freedom or solution.cases)
    return "after" if has_before(solution) or placed else "posture"


def stage_titles(solution: Solution) -> tuple[str, ...]:
    """Titles of the columns of a result's tables."""
    return ("before",) * has_before(solution) + (answer_word(solution),)


def largest_share(shares: dict[str, tuple[float, ...]]) -> float:
    """The largest share of a torque limit, over all joints of all arms."""
    return max(max(joints) for joints in shares.values())


def evidence_words(solution: Answer) -> str:
    """The chance of ends that a search never met, and the bound that it has; empty where neither
    is known.
    """
    words, search = list[str](), solution.search
    end = "motion" if isinstance(solution, Motion) else "optimum"
    unseen = None if search is None or search.basins is None else search.basins.unseen
    if unseen == 1:
        words.append(f"each {end} was met once: that does not tell how many more there are")
    elif unseen is not None:
        chance = f"a chance of about {percent(unseen)} % (Good-Turing)"
        words.append(f"one more start finds another {end} with {chance}")
    if isinstance(search, SearchRecord) and search.bound is not None:
        words.append(f"no combination of the samples is worth more than {six(search.bound)}")
    return "; ".join(words)


def short(name: str, most: int = 20) -> str:
    """A name cut to fit into a picture."""
    return name if len(name) <= most else name[: most - 1] + "…"


def result_heading(solution: Solution) -> str:
    """The heading of a picture: the problem's name and the gain."""
    return ": ".join(
        part for part in (short(solution.problem.name, 60), gain_words(solution)) if part
    )


def motion_heading(motion: Motion) -> str:
    """The heading of a motion's picture: the problem's name and the gain over least-norm tracking,
    or the value where there is no gain.
    """
    name, objective = short(motion.problem.name, 60), motion.objective
    gained = gain_between(motion, objective.before, objective.after)
    if gained:
        over = {"mean": "on average", "worst": "at its worst"}[motion.aggregate]
        return f"{name}: {gain_word(motion)} {gained} {over}, against least-norm tracking"
    words = f"{motion.aggregate} {objective_name(motion)} {three(objective.after)}"
    fails = motion.least_norm is not None and motion.least_norm.reason is not None
    failed = f"; least-norm tracking fails {failure_words(motion)}" if fails else ""
    return f"{name}: {words} {objective_unit(motion)}".rstrip() + failed


def failure_words(motion: Motion) -> str:
    """The time at which least-norm tracking fails."""
    tracking, time = motion.least_norm, motion.time
    assert tracking is not None and time is not None
    known = [t for t, value in zip(time, tracking.objective, strict=True) if value is not None]
    return f"after {three(known[-1])} s" if known else "at once"
