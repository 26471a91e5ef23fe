"""States of the page, steps that an undo goes back to, and aims of a search."""

from __future__ import annotations

from dataclasses import dataclass

from copose.live.problem_file.document import Changes, Document
from copose.poses import Array
from copose.posture.search.effort import EffortName
from copose.problem import Problem
from copose.results import Optimum, Posture, Solution


@dataclass(frozen=True, eq=False)
class State:
    """A problem, the posture that is shown and its values.

    Attributes:
        problem: the problem as it would be saved.
        solution: the result whose ``after`` is shown; where nothing has held the object yet, its
            ``nearest_miss``.
        start: the posture with which the page opened, or the first that held the object.
        start_value: the objective there, by the settings of the solution; None where it has none.
        shares: shares of the joints' torque limits that hold the object at rest, by arm; None where
            they are not known.
        optima: local optima of the last search, the best first.
        message: why the object cannot be where it is, or what else went wrong; empty if nothing.
        reached: whether the arms hold the object where it is.
        searched: whether the posture is the best of a search here.
        origin: where a posture was recorded, such as a point of a study; empty of all others.
        left: the posture that a search has left for this one, where the arms would have to let go
            to come from there; None else.
        undoable: whether there is something to undo.
    """

    problem: Problem
    solution: Solution
    start: Posture | None = None
    start_value: float | None = None
    shares: dict[str, Array] | None = None
    optima: tuple[Optimum, ...] = ()
    message: str = ""
    reached: bool = False
    searched: bool = False
    origin: str = ""
    left: Posture | None = None
    undoable: bool = False

    @property
    def posture(self) -> Posture | None:
        """The drawn posture: the one that holds the object, else the nearest miss."""
        return self.solution.after or self.solution.nearest_miss

    @property
    def value(self) -> float | None:
        """The objective of the posture."""
        return self.solution.objective.after


@dataclass(frozen=True, eq=False)
class Step:
    """A state that an undo goes back to."""

    document: Document  # the problem that changes are of
    changes: Changes  # from it
    start_places: Changes  # places of everything at the start of the arms
    state: State


@dataclass(frozen=True)
class SearchAim:
    """The effort, seed and checks of a search: verification, and the ε of a proof."""

    effort: EffortName = "normal"
    seed: int | None = None
    verify: bool = False
    prove: float | None = None
