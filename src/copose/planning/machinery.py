"""Everything that is built once for a problem, whatever is asked of it afterwards."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose import kernels
from copose.planning.arm_kernels import ArmKernels, Placement, Placer
from copose.planning.cell import Cell
from copose.planning.measuring import Measures, Meter, closure_errors
from copose.planning.objectives import Objective, objective_of
from copose.planning.polishing import Crew, Polisher
from copose.planning.program import PostureProgram
from copose.planning.screening import Score
from copose.poses import Array

# s
_LOOK_AGAIN = 0.5


@dataclass(frozen=True, eq=False)
class Setting:
    """A cell with its object somewhere, and what the kernels take for it.

    Attributes:
        cell: the object's pose is its problem's.
        placement: of the object, as the arms' kernels take it.
        given: M_o and the objective's numbers, as the score's kernels take them.
        lower: joint limits by arm; infinite for joints that can turn all the way, which have none.
        upper: alike.
    """

    cell: Cell
    placement: Placement
    given: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Limits of all joints, stacked."""
        return np.concatenate(self.lower), np.concatenate(self.upper)


class Machinery:
    """Expressions, kernels and programs of a cell; object pose, mass and limits are numbers.

    Attributes:
        cell: as the file has it.
        objective: what is maximised.
        arms: kernels by arm; arms of one model share them.
        score: of the sums of the arms' terms.
        meter: measures what is reported.
        smooth: whether the score is the objective itself.
    """

    def __init__(self, cell: Cell) -> None:
        """Build what a search needs; the posture program follows when it is asked for."""
        self.cell = cell
        self.objective: Objective = objective_of(cell.problem)
        models: dict[bytes, ArmKernels] = {}
        for arm, mechanics in zip(cell.arms, cell.system.arms, strict=True):
            if arm.fingerprint not in models:
                models[arm.fingerprint] = ArmKernels.of(mechanics, cell.resolution)
        self.arms = tuple(models[arm.fingerprint] for arm in cell.arms)
        self.score = Score(cell.system, cell.resolution, self.objective, cell.problem.axes)
        self.meter = Meter(cell)
        self.smooth = self.score.smooth
        self._placer = Placer(cell.system, cell.scales)
        self._looked: float | None = None
        own = [kernel for model in models.values() for kernel in model.all]
        self._kernels = (*own, *self.score.all, self._placer.kernel)

    @cached_property
    def program(self) -> PostureProgram:
        """The posture program, for IPOPT."""
        return PostureProgram(self.cell.system, self.cell.gram, self.objective)

    def compiled(self, *, wait: bool = False) -> bool:
        """Whether compiled kernels are in use; what is missing is compiled, see `kernels.build`."""
        if wait or self._looked is None:
            self._looked = time.monotonic()
            return kernels.build(self._kernels, wait=wait)
        # The compiler was set to work once; whether it has ended need not be asked at every call.
        if not self.compiled_already and time.monotonic() > self._looked + _LOOK_AGAIN:
            self._looked = time.monotonic()
            for kernel in self._kernels:
                kernel.load()
        return self.compiled_already

    @property
    def compiled_already(self) -> bool:
        """Whether compiled kernels are in use."""
        return all(kernel.compiled for kernel in self._kernels)

    def setting(self, cell: Cell) -> Setting:
        """A cell of these arms, for the kernels."""
        placement = self._placer(cell.parameters)
        turns = [cell.turns(i) for i in range(len(cell.arms))]
        return Setting(
            cell=cell,
            placement=placement,
            given=np.concatenate([placement.inertia, self.objective.numbers]),
            lower=tuple(
                np.where(t, -np.inf, low) for t, low in zip(turns, cell.lower, strict=True)
            ),
            upper=tuple(
                np.where(t, np.inf, high) for t, high in zip(turns, cell.upper, strict=True)
            ),
        )

    def polisher(
        self, setting: Setting, only: int | None = None, rest: Array | float = 0.0
    ) -> Polisher:
        """Climbs the score in a setting.

        Args:
            setting: where the object is.
            only: an arm that moves alone.
            rest: what the others then add to the sums, (s,).
        """
        moving = range(len(self.arms)) if only is None else [only]
        edges = np.cumsum([0] + [self.arms[i].n for i in moving])
        place, crews = setting.placement, []
        for kernels_ in dict.fromkeys(self.arms[i] for i in moving):
            mates = [(i, edge) for i, edge in zip(moving, edges, strict=False)
                     if self.arms[i] is kernels_]  # fmt: skip
            crews.append(
                Crew(
                    kernels=kernels_,
                    columns=np.array([edge + np.arange(kernels_.n) for _, edge in mates]),
                    goals=np.array([place.goals[i] for i, _ in mates]),
                    ties=np.array([place.ties[i] for i, _ in mates]),
                    lower=np.array([setting.lower[i] for i, _ in mates]),
                    upper=np.array([setting.upper[i] for i, _ in mates]),
                )
            )
        return Polisher(crews, self.score, setting.given, rest)

    def grams(self, setting: Setting, q: Sequence[Array]) -> Array:
        """G of postures, by arm (count, n_i), as it is optimised, (count, a, a)."""
        ties = setting.placement.ties
        sums = sum(arm.terms(mine, tie) for arm, mine, tie in zip(self.arms, q, ties, strict=True))
        entries = self.score.gram(np.asarray(sums), setting.given)
        a = len(setting.cell.problem.axes)
        grams = np.empty((len(entries), a, a))
        rows, columns = np.triu_indices(a)
        grams[:, rows, columns] = grams[:, columns, rows] = entries
        return grams

    def objectives(self, setting: Setting, q: Array) -> Array:
        """The objective at postures, (count, N); NaN or −inf where there is none."""
        edges = np.cumsum([arm.n for arm in self.arms])[:-1]
        return self._objectives(self.grams(setting, np.split(q, edges, axis=1)))

    def _objectives(self, grams: Array) -> Array:
        values = np.full(len(grams), np.nan)
        sound = np.isfinite(grams).all(axis=(1, 2))
        values[sound] = self.objective.of_grams(grams[sound])
        return values

    def measures(self, setting: Setting, q: Sequence[Array]) -> Measures:
        """What postures are worth, by arm (count, n_i)."""
        space = setting.cell.system.space
        errors = {}
        for i, (arm, kernels_, mine) in enumerate(
            zip(setting.cell.arms, self.arms, q, strict=True)
        ):
            gaps = kernels_.gap(mine, setting.placement.goals[i])
            errors[arm.name] = closure_errors(gaps[:, list(space.linear)], gaps[:, 3:], space.rigid)
        grams = self.grams(setting, q)
        return Measures(self._objectives(grams), grams, errors)
