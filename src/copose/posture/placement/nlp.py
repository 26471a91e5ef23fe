"""The posture program over everything that is free, in all cases at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from copose.cell.cell import Cell
from copose.objectives.objective import Cuts
from copose.poses import Array
from copose.posture.local.nlp_cuts import NlpCuts
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalSolve
from copose.posture.placement.placed import Placed
from copose.posture.setting import Setting
from copose.posture.solvers.constraint_generation import GenerationOptions, ProgramEnd, generate
from copose.posture.solvers.nlp import Given


@dataclass(frozen=True)
class PlacementNlpOptions:
    """Options of constraint generation with a trust box, over everything that is free."""

    runs: int = 12  # of IPOPT from one start
    free_runs: int = 3  # first runs, which go wherever they lead
    shrink: float = 0.3  # of the part of the way that a run may go after one that led astray
    smallest_box: float = 1e-6  # rad or m
    loss: float = 1e-9  # relative, by which rounding may make an end worse
    least_gain: float = 1e-7  # of a late run, after which the next is not worth its time
    collision_runs: int = 4  # of one program with what it has run into


class PlacementNlp:
    """Climbs over everything that is free by IPOPT.

    Attributes:
        failures: runs that ended nowhere.
    """

    def __init__(
        self,
        model: PostureModel,
        cases: Sequence[Cell],
        weights: Sequence[float],
        options: PlacementNlpOptions = PlacementNlpOptions(),
    ) -> None:
        """Programs of a model for the cell in every case, with weights of the cases' objectives."""
        self._model, self._cases, self._weights = model, cases, weights
        self._places, self._options = model.places, options
        self.failures: list[LocalSolve] = []

    def setting(self, k: int, x: Array) -> Setting:
        """Case k with everything moved by x, (d,)."""
        return self._model.setting(self._places.freedom.at(self._cases[k], x))

    def climb(self, start: Placed) -> Placed:
        """The local optimum that a placement leads to; never anything worse.

        Demands that a run of IPOPT left out join the next. Where a run leads astray the next may
        go less far.
        """
        options = self._options
        loose = self._model.objective.piecewise
        free = options.free_runs if loose else 0
        last = options.runs if loose else options.free_runs
        generation = GenerationOptions(
            rounds=options.runs, free_rounds=free, shrink=options.shrink,
            smallest_box=options.smallest_box, always_bounded=True, patient=True, stuck_way=1.0,
            last_rejection=last, least_gain=options.least_gain, gain_round=options.free_runs,
        )  # fmt: skip

        def solve(
            origin: Placed, cuts: list[Cuts], room: float
        ) -> ProgramEnd[Placed, list[Cuts]] | None:
            solved = self._solved(origin, cuts, room)
            if solved is None:
                return None
            if not solved.converged:
                self.failures.append(solved)
                return None
            end = self._evaluated(solved.q)
            way = float(np.abs(solved.q - self.stacked(origin)).max())
            return ProgramEnd(end, end.value, way, self._violated(end, cuts))

        def accepts(step: ProgramEnd[Placed, list[Cuts]], best: float, _: bool) -> bool:
            return step.value > best - options.loss * (1 + abs(best))

        return generate(start, start.value, self._cuts(start), solve, accepts, generation)

    def stacked(self, placed: Placed) -> Array:
        """A placement as the variables of the program."""
        return np.concatenate([*placed.q, self._places.joined(placed.x)])

    def placed(self, variables: Array, value: float = -np.inf) -> Placed:
        """The placement of the variables of the program."""
        size = self._places.size
        q = np.split(variables[: len(variables) - size], len(self._cases))
        x = self._places.parted(variables[len(variables) - size :])
        return Placed(tuple(x), tuple(q), value)

    def _evaluated(self, variables: Array) -> Placed:
        """The placement, with its value, of the variables of the program."""
        end = self.placed(variables)
        values = [
            self._model.objectives(self.setting(k, x), q[None])[0]
            for k, (x, q) in enumerate(zip(end.x, end.q, strict=True))
        ]
        total = float(np.dot(self._weights, values))
        return replace(end, value=total) if np.isfinite(total) else end

    def _cuts(self, placed: Placed) -> list[Cuts]:
        """Demands of the objective that count in each case."""
        cuts = []
        for k, q in enumerate(placed.q):
            setting, parts = self.setting(k, placed.x[k]), self._model.split(q[None])
            cuts.append(setting.objective.cuts(setting, parts)[0])
        return cuts

    def _violated(self, placed: Placed, cuts: list[Cuts]) -> list[Cuts] | None:
        """Demands with those that a run left out; None where it left out none."""
        added = []
        for k, q in enumerate(placed.q):
            setting, parts = self.setting(k, placed.x[k]), self._model.split(q[None])
            added.append(setting.objective.more_cuts(setting, parts, cuts[k]))
        if all(new is None for new in added):
            return None
        return [old if new is None else new for old, new in zip(cuts, added, strict=True)]

    def _solved(self, origin: Placed, cuts: list[Cuts], room: float) -> LocalSolve | None:
        """A run of IPOPT over everything, with what it runs into kept apart.

        Args:
            origin: where it starts.
            cuts: demands of the objective, by case.
            room: how far variables may go, rad or m.

        Returns:
            The end; None where the program cannot be started.
        """
        model, programs = self._model, NlpCuts(self._model)
        settings = [self.setting(k, x) for k, x in enumerate(origin.x)]
        numbers, slack = [], []
        for k, (setting, q) in enumerate(zip(settings, origin.q, strict=True)):
            parameters, extra = programs.given(setting, q[None], [cuts[k]])
            if not np.all(np.isfinite(extra)):
                return None
            numbers.append(np.concatenate([*parameters, setting.placement.inertia]))
            slack.append(extra[0])
        places = [self._places.freedom.numbers(cell) for cell in self._cases]
        start = self.stacked(origin)
        lower, upper = self._box(settings, start, room)
        near = [programs.near(s, q) for s, q in zip(settings, origin.q, strict=True)]
        end = None
        for _ in range(self._options.collision_runs):
            apart = programs.apart(near)
            given = [
                Given(
                    places[k],
                    np.concatenate([numbers[k], programs.kept_apart(apart, near[k])]),
                    slack[k],
                    self._weights[k],
                )
                for k in range(len(settings))
            ]
            end = model.built(self._places, apart).solve(start, given, lower, upper)
            if not end.converged:
                return end
            placed = self._evaluated(end.q)
            hits = [
                programs.witnesses(self.setting(k, x), q)
                for k, (x, q) in enumerate(zip(placed.x, placed.q, strict=True))
            ]
            if not any(hits):
                return end
            near = [known + hit for known, hit in zip(near, hits, strict=True)]
        return None if end is None else replace(end, converged=False, status="Collision")

    def _box(self, settings: Sequence[Setting], start: Array, room: float) -> tuple[Array, Array]:
        """Bounds of the variables no farther than ``room`` from a start."""
        bounds = [*(setting.bounds for setting in settings), self._places.bounds]
        lower = np.concatenate([low for low, _ in bounds])
        upper = np.concatenate([high for _, high in bounds])
        return np.maximum(lower, start - room), np.minimum(upper, start + room)
