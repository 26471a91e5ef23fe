"""Effort of a search for a motion: its options, and three efforts by name."""

from __future__ import annotations

from dataclasses import dataclass, field

from copose.errors import InputError
from copose.motion.search.candidates import TrialOptions
from copose.motion.search.motion_search import MakingOptions
from copose.motion.search.refinement import FinisherOptions
from copose.posture.search.effort import EffortName


@dataclass(frozen=True)
class PathEffort:
    """Options of a search for a motion."""

    # Of layers, durations, and postures among bodies.
    making: MakingOptions = field(default_factory=MakingOptions)
    # Of the routes that are optimised.
    routes: TrialOptions = field(default_factory=TrialOptions)
    # Of knots and margins.
    refining: FinisherOptions = field(default_factory=FinisherOptions)


PATH_EFFORTS: dict[EffortName, PathEffort] = {
    "low": PathEffort(routes=TrialOptions(routes=1, more_routes=2, even=1)),
    "normal": PathEffort(),
    "high": PathEffort(
        making=MakingOptions(layers=49, still_layers=161, free_layers=9),
        routes=TrialOptions(routes=12, more_routes=24, even=4),
    ),
}


def path_effort_of(effort: EffortName | PathEffort) -> PathEffort:
    """An effort by its name, or one with options of its own.

    Raises:
        InputError: there is none of that name.
    """
    if isinstance(effort, PathEffort):
        return effort
    if effort not in tuple(PATH_EFFORTS):
        raise InputError(f"{effort!r} is not low, normal or high", key="effort")
    return PATH_EFFORTS[effort]
