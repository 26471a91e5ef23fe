"""Everything that is built once for a problem, whatever is asked of it afterwards."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from copose import kernels
from copose.capability import HoldingTorque
from copose.capability.torque_limits import Demand
from copose.cell.cell import Cell
from copose.cell.dynamics import HELD, CellDynamics, Holding
from copose.cell.freedom import Freedom
from copose.cell.variables import Places
from copose.collision import Bodies, Scene, Witness
from copose.constraints.clearance import (
    EXACT,
    ROWS,
    SPARE,
    TOUCHING,
    Apart,
    configurations_of,
    held_back,
    of_two,
    overlap_notes,
    rows_of,
    with_collision,
)
from copose.errors import InputError
from copose.kernels import Kernel
from copose.measurement.meter import Measurement, Measures, Meter, closure_errors
from copose.objectives.build import objective_of
from copose.objectives.ellipsoid_measures import EllipsoidMeasure, Objective
from copose.objectives.limits_measures import LimitsMeasure
from copose.poses import Array, Mask
from copose.posture.optimum import LocalOptimum
from copose.posture.search.screening import Score
from copose.posture.solvers.newton import ArmGroup, Polisher
from copose.posture.solvers.nlp import Given, LocalSolve, PostureProgram
from copose.progress import stage
from copose.results import LinkRecord, link_records
from copose.self_motion.kernels import ArmKernels, KernelInputsBuilder, Placement, terms_kernel

# s
_LOOK_AGAIN = 0.5
# Solves in which demands that a program left out join it, the first of which wander; the part of
# the way that the next may go after one that led astray, and how little is too little, rad or m.
_EXCHANGES, _WANDER, _NEARER, _NO_ROOM = 20, 6, 0.3, 1e-6
# What a climb may lose by rounding, relative.
_LOSS = 1e-9
# Bodies that are less than this farther apart than they must be matter to a program, m.
MATTERS = 0.01
# Where there are none, those do that are less than this farther apart.
_FARTHER = 0.1
# How often a program is solved with what it has run into.
_COLLISIONS = 12
# What comes within this of the best, relative, is followed along bodies that it touches.
_NEAR_BEST = 3e-5
# For as long as it gains so much: what it would gain next is of the order of the square.
_GAIN = 1e-6
# Not what is farther below the best than so many times what that has gained.
_HOPE = 3.0
# Optima of which the first that keeps clear is looked for.
_LOOKED_AT = 16


@dataclass(frozen=True, eq=False)
class Setting:
    """A cell with its object somewhere, and what the kernels take for it.

    Attributes:
        cell: the object's pose is its problem's.
        objective: what is maximised there.
        placement: of the object, as the arms' kernels take it.
        given: M_o, the object's weight and the objective's numbers, as the score's kernels take
            them.
        lower: joint limits by arm; infinite for joints that can turn all the way, which have none.
        upper: alike.
        numbers: parameters of the objective.
        holding: how the object is held, where torque limits matter.
        held_ties: what the kernels of `HoldingTorque` take, by arm.
        bodies: what must keep the clearance; None where nothing need.
    """

    cell: Cell
    objective: Objective
    placement: Placement
    given: Array
    lower: tuple[Array, ...]
    upper: tuple[Array, ...]
    numbers: Array
    holding: Holding | None
    held_ties: tuple[Array, ...]
    bodies: Bodies | None

    def configurations(self, q: Sequence[Array | None]) -> Array:
        """See `configurations_of`."""
        return configurations_of(self.cell, q)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Limits of all joints, stacked."""
        return np.concatenate(self.lower), np.concatenate(self.upper)


class PostureModel:
    """Expressions, kernels and programs of a cell; object pose, mass and limits are numbers.

    Attributes:
        cell: as the file has it.
        objective: what is maximised.
        arms: kernels by arm; arms of one model share them.
        score: of the sums of the arms' terms.
        meter: measures what is reported.
        capacity: what torque limits allow, where they matter.
        static: whether arms at rest must hold the object within their torque limits.
        newton: whether Newton steps climb the score.
        smooth: whether the score is then the objective itself.
        dear: whether a climb takes many programs.
        bodies: that may not touch, if any.
    """

    def __init__(self, cell: Cell, objective: Objective | None = None) -> None:
        """Build what a search needs; the posture program follows when it is asked for.

        Args:
            cell: what is searched.
            objective: in place of the problem's.
        """
        self.cell = cell
        self.objective: Objective = objective_of(cell) if objective is None else objective
        self._given = objective
        self.static = cell.problem.constraints.static_torque
        self.capacity = None
        if isinstance(self.objective, LimitsMeasure) or self.static:
            self.capacity = CellDynamics(cell, cell.counted_limits)
        models: dict[bytes, ArmKernels] = {}
        held: dict[bytes, Kernel] = {}
        for arm, mechanics in zip(cell.arms, cell.system.arms, strict=True):
            if arm.fingerprint not in models:
                models[arm.fingerprint] = ArmKernels.of(mechanics, self.objective.sums)
                if self.static:
                    held[arm.fingerprint] = terms_kernel(mechanics, HoldingTorque())
        self.arms = tuple(models[arm.fingerprint] for arm in cell.arms)
        self._held = tuple(held[arm.fingerprint] for arm in cell.arms) if held else ()
        self._placer = KernelInputsBuilder(cell.system, self.objective.sums, self.objective.scales)
        self._held_placer = None
        if self.static and cell.torque_limits is not None:
            self._held_placer = KernelInputsBuilder(
                cell.system, HoldingTorque(), cell.torque_limits
            )
        self._nominal, numbers = self._numbers_of(cell, self.objective)
        self._numbers = len(numbers)
        self.score = Score(cell, self.objective, self._numbers)
        self.meter = Meter(cell, self.objective, self.capacity)
        self.newton = isinstance(self.objective, EllipsoidMeasure)
        self.smooth = isinstance(self.objective, EllipsoidMeasure) and not self.objective.kinked
        self.dear = isinstance(self.objective, LimitsMeasure) and self.objective.dear
        self.bodies = self.every_body if cell.problem.constraints.collision else None
        self._built: dict[tuple[bool, Apart | None], PostureProgram] = {}
        self._looked: float | None = None
        own = [kernel for model in models.values() for kernel in model.all]
        self._kernels = (*own, *held.values(), *self.score.all, self._placer.kernel)
        if self.capacity is not None:
            self._kernels += self.capacity.kernels

    @cached_property
    def scene(self) -> Scene:
        """All bodies, and which of them may not touch.

        Raises:
            InputError: an arm has no shape.
        """
        return Scene.of(self.cell.problem, self.cell.arms)

    @cached_property
    def every_body(self) -> Bodies:
        """The same, to be asked."""
        return self.scene.bodies(self.cell.arms, self.cell.problem.constraints.clearance)

    def _numbers_of(self, cell: Cell, objective: Objective) -> tuple[Holding | None, Array]:
        """How the object of a cell is held, and an objective's parameters there."""
        holding = None if self.capacity is None else self.capacity.holding(cell)
        if isinstance(objective, EllipsoidMeasure):
            return holding, objective.numbers
        assert isinstance(objective, LimitsMeasure) and holding is not None
        return holding, objective.numbers(objective.demands(holding))

    @property
    def program(self) -> PostureProgram:
        """The posture program, for IPOPT."""
        return self.built(None, None)

    @cached_property
    def places(self) -> Places:
        """What is free beside the joints, for all cases."""
        cases = tuple(case.name for case in self.cell.problem.cases) or ("",)
        return Places(self.cell, Freedom.of(self.cell.problem), cases)

    def built(self, places: Places | None, apart: Apart | None) -> PostureProgram:
        """The posture program, with all cases and everything that is free where ``places`` are
        given, and with rows that keep bodies apart.
        """
        key = places is not None, apart
        if key not in self._built:
            numbers = self._numbers
            if isinstance(self.objective, LimitsMeasure) and self._nominal is not None:
                demands = self.objective.demands(self._nominal)[: self.objective.programmed]
                numbers = len(self.objective.numbers(demands))
            self._built[key] = PostureProgram(
                self.cell, self.objective, numbers, self.capacity, places, apart
            )
        return self._built[key]

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
        objective = self.objective
        if self._given is None and cell.problem.objective is not self.cell.problem.objective:
            objective = objective_of(cell)
        holding, numbers = self._numbers_of(cell, objective)
        weight = np.zeros(len(cell.system.space.balance)) if holding is None else holding.weight
        turns = [cell.turns(i) for i in range(len(cell.arms))]
        return Setting(
            cell=cell,
            objective=objective,
            placement=placement,
            given=np.concatenate([placement.inertia, weight, numbers]),
            lower=tuple(
                np.where(t, -np.inf, low) for t, low in zip(turns, cell.lower, strict=True)
            ),
            upper=tuple(
                np.where(t, np.inf, high) for t, high in zip(turns, cell.upper, strict=True)
            ),
            numbers=numbers,
            holding=holding,
            held_ties=(
                () if self._held_placer is None else self._held_placer(cell.parameters).ties
            ),
            bodies=self.bodies,
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
        place, crews = setting.placement, []
        every = range(len(self.arms)) if only is None else [only]
        edges = np.cumsum([0] + [self.arms[i].n for i in every])
        moving = [i for i in every if not setting.cell.arms[i].fixed]
        edges = edges[[every.index(i) for i in moving]]
        for i in every:
            if i not in moving:
                start = np.asarray(setting.cell.arms[i].start)[None]
                rest = rest + self.arms[i].terms(start, place.ties[i])[0]
        for kernels_ in dict.fromkeys(self.arms[i] for i in moving):
            mates = [(i, edge) for i, edge in zip(moving, edges, strict=True)
                     if self.arms[i] is kernels_]  # fmt: skip
            crews.append(
                ArmGroup(
                    kernels=kernels_,
                    columns=np.array([edge + np.arange(kernels_.n) for _, edge in mates]),
                    goals=np.array([place.goals[i] for i, _ in mates]),
                    ties=np.array([place.ties[i] for i, _ in mates]),
                    lower=np.array([setting.lower[i] for i, _ in mates]),
                    upper=np.array([setting.upper[i] for i, _ in mates]),
                )
            )
        return Polisher(crews, self.score, setting.given, rest)

    def terms(self, setting: Setting, i: int, q: Array) -> Array:
        """What arm i adds to the sums that postures are compared by, (count, s), at (count, n)."""
        own = self.arms[i].terms(q, setting.placement.ties[i])
        return np.hstack([own, self._held[i](q, setting.held_ties[i])]) if self._held else own

    def grams(self, setting: Setting, q: Sequence[Array]) -> Array | None:
        """G of postures, by arm (count, n_i), as it is optimised, (count, a, a); or None."""
        if self.score.gram is None:
            return None
        ties = setting.placement.ties
        sums = sum(arm.terms(mine, tie) for arm, mine, tie in zip(self.arms, q, ties, strict=True))
        return self.grams_of(setting, np.asarray(sums))

    def grams_of(self, setting: Setting, sums: Array) -> Array:
        """The same of the arms' sums, (count, s)."""
        assert self.score.gram is not None
        entries = self.score.gram(sums, setting.given)
        a = len(setting.cell.problem.axes)
        grams = np.empty((len(entries), a, a))
        rows, columns = np.triu_indices(a)
        grams[:, rows, columns] = grams[:, columns, rows] = entries
        return grams

    def objectives(self, setting: Setting, q: Array) -> Array:
        """The objective at postures, (count, N); NaN or −inf where there is none."""
        parts = self.split(q)
        return self._objectives(setting, parts, self.grams(setting, parts))

    def split(self, q: Array) -> list[Array]:
        """Stacked postures, (count, N), arm by arm."""
        edges = np.cumsum([arm.n for arm in self.arms])[:-1]
        return np.split(q, edges, axis=1)

    def objectives_of(self, setting: Setting, sums: Array) -> Array:
        """The same of the arms' sums, (count, s), where the objective measures an ellipsoid."""
        return self._of_grams(setting.objective, self.grams_of(setting, sums))

    @staticmethod
    def _of_grams(objective: Objective, grams: Array | None) -> Array:
        assert grams is not None and isinstance(objective, EllipsoidMeasure)
        values = np.full(len(grams), np.nan)
        sound = np.isfinite(grams).all(axis=(1, 2))
        values[sound] = objective.of_grams(grams[sound])
        return values

    def _objectives(self, setting: Setting, q: Sequence[Array], grams: Array | None) -> Array:
        objective = setting.objective
        if isinstance(objective, EllipsoidMeasure):
            return self._of_grams(objective, grams)
        assert isinstance(objective, LimitsMeasure)
        assert self.capacity is not None and setting.holding is not None
        return objective.exact(self.capacity, setting.cell, setting.holding, q)

    def estimates(self, setting: Setting, q: Array) -> Array:
        """The objective at postures, (count, N), or a bound of it that is quicker."""
        if not isinstance(setting.objective, LimitsMeasure):
            return self.objectives(setting, q)
        assert self.capacity is not None and setting.holding is not None
        return setting.objective.estimates(self.capacity, setting.holding, self.split(q))

    def shares(self, setting: Setting, q: Array) -> Array:
        """The largest share of a torque limit with which postures hold the object, (count,)."""
        assert self.capacity is not None and setting.holding is not None
        dynamics = self.capacity.dynamics(setting.holding, self.split(q))
        return dynamics.shares(setting.holding.hold)

    def held(self, setting: Setting, q: Array) -> Mask:
        """Which postures, (count, N), hold the object as ``static_torque`` asks, (count,)."""
        if not self.static:
            return np.ones(len(q), dtype=bool)
        return np.asarray(self.shares(setting, q) <= 1 + HELD)

    def clear(self, setting: Setting, q: Array) -> Mask:
        """Which postures, (count, N), keep the clearance, (count,)."""
        if setting.bodies is None or not len(q):
            return np.ones(len(q), dtype=bool)
        return setting.bodies.clear(setting.configurations(self.split(q)))

    def first_apart(self, setting: Setting, optima: Sequence[LocalOptimum]) -> LocalOptimum | None:
        """The first that keeps the clearance, of as many as are worth the time."""
        for optimum in optima[:_LOOKED_AT]:
            if self.clear(setting, optimum.q[None])[0]:
                return optimum
        return None

    def allowed(self, setting: Setting, q: Array) -> Mask:
        """Which postures, (count, N), hold the object and keep the clearance, (count,)."""
        allowed = self.clear(setting, q)
        if self.static and allowed.any():
            allowed[allowed] = self.held(setting, q[allowed])
        return allowed

    def solve_programs(self, setting: Setting, q: Array) -> Iterator[LocalSolve]:
        """Runs of IPOPT from postures, (count, N)."""
        objective, holding = setting.objective, setting.holding
        if all(arm.fixed for arm in setting.cell.arms):
            # IPOPT refuses a program without freedom, in which each posture is its own optimum.
            for start, allowed in zip(q, self.allowed(setting, q), strict=True):
                yield LocalSolve(start, bool(allowed), "Fixed", {}, 0.0)
            return
        if self.capacity is None or holding is None or not isinstance(objective, LimitsMeasure):
            yield from self._programs(setting, q, None)
            return
        demands = self.demands(setting, q)
        if not objective.dear:
            ends = self._programs(setting, q, demands)
            there = self.objectives(setting, np.array([end.q for end in ends]))
            lost = ~(there >= self.objectives(setting, q) - _LOSS * (1 + np.abs(there)))
            for start, end, wanted, leave in zip(q, ends, demands, lost, strict=True):
                # It has left for a worse optimum, or failed.
                yield self._exchanged(setting, start, wanted) if leave else end
            return
        for start, wanted in zip(q, demands, strict=True):
            yield self._exchanged(setting, start, wanted)

    def _exchanged(self, setting: Setting, start: Array, demands: tuple[Demand, ...]) -> LocalSolve:
        """Runs of IPOPT until no demand is left out, each better than the one before.

        Demands that a run left out join the next. The first runs go wherever they lead, and the
        best of their ends counts. Where a later one ends worse than it began, for the demands that
        count have changed on its way, the next may go less far.
        """
        objective, cell, holding = setting.objective, setting.cell, setting.holding
        assert isinstance(objective, LimitsMeasure)
        assert self.capacity is not None and holding is not None
        best, value, room = start, self.objectives(setting, start[None])[0], np.inf
        lower, upper = setting.bounds
        end = LocalSolve(start, False, "Singular_Start", {})
        here = best
        for k in range(_EXCHANGES):
            if k >= _WANDER:
                here = best
            box = np.maximum(lower, here - room), np.minimum(upper, here + room)
            found = self._programs(setting, here[None], [demands], box)[0]
            if not found.converged:
                break
            parts = self.split(found.q[None])
            there = objective.exact(self.capacity, cell, holding, parts)[0]
            more = self.tightened(setting, found.q[None], demands)
            far, here = float(np.abs(found.q - here).max()), found.q
            if there > value or (more is None and not end.converged and far < _NO_ROOM):
                best, value, end = found.q, there, found
                if more is None and far < room * (1 - 1e-6):
                    break
            elif k >= _WANDER:
                room = min(room, far) * _NEARER
                if room < _NO_ROOM:
                    break
            demands = demands if more is None else more
        return end

    def _programs(
        self,
        setting: Setting,
        q: Array,
        demands: Sequence[Sequence[Demand]] | None,
        bounds: tuple[Array, Array] | None = None,
    ) -> list[LocalSolve]:
        """The same with the demands of each start, where the objective has some.

        What ends touching bodies and near the best is followed along them.
        """
        bounds = setting.bounds if bounds is None else bounds
        numbers, beside = self.given(setting, q, demands)
        ends, best = [], -np.inf
        for k, start in enumerate(q):
            stage("polishing", k, len(q))
            ends.append(self._climb(setting, start, numbers[k], beside[k], bounds, best))
            if ends[k].converged:
                best = max(best, self.objectives(setting, ends[k].q[None])[0])
        if setting.bodies is None:
            return ends
        values = self.objectives(setting, np.array([end.q for end in ends]))
        most = _NEAR_BEST * max(1.0, abs(best))
        for k in np.argsort(-values, kind="stable"):
            if ends[k].converged and not values[k] < best - most:
                ends[k] = self._followed(setting, ends[k], numbers[k], beside[k], bounds)
                end = self.objectives(setting, ends[k].q[None])[0]
                # What the best has gained says how much others may.
                best, most = max(best, end), min(most, _HOPE * (end - values[k]))
        return ends

    def _climb(
        self,
        setting: Setting,
        start: Array,
        numbers: Array,
        beside: Array,
        bounds: tuple[Array, Array],
        best: float,
    ) -> LocalSolve:
        """A run of IPOPT from a posture, (N,), or as many as it takes to keep bodies apart.

        Rows hold at every start, so that no program is without a feasible point.
        """
        bodies, known, value = setting.bodies, None, -np.inf
        cuts, room, met = self.near(setting, start), np.inf, set[int]()
        for _ in range(_COLLISIONS):
            box = np.maximum(bounds[0], start - room), np.minimum(bounds[1], start + room)
            end = self._run(setting, cuts, start, numbers, beside, box)
            if not end.converged:
                return end if known is None else known
            there = self.objectives(setting, end.q[None])[0]
            # Where a run is dear: what keeps clear of more will hardly be better.
            if self.capacity is not None and known is None and not there > best:
                return replace(end, converged=False, status="Below_Best")
            if bodies is None:
                return end
            before, x = setting.configurations(self.split(np.array([start, end.q])))
            touching = bodies.witnesses(x, bodies.clearance + TOUCHING)
            hit = [each for each in touching if each.distance < bodies.clearance]
            far = np.abs(end.q - start).max()
            if hit:
                if known is None and there < best - _NEAR_BEST * max(1.0, abs(best)):
                    return replace(end, converged=False, status="Below_Best")
                # What it has run into joins the pairs that matter; where that has not been enough
                # it may go half as far.
                pairs = {each.pair for each in hit}
                if pairs & met:
                    room = far / 2
                met |= pairs
                hold = rows_of(bodies, hit, before) >= bodies.clearance + SPARE
                cuts += tuple(each for each, holds in zip(hit, hold, strict=True) if holds)
                cuts += tuple(
                    bodies.witnesses(before, np.inf, np.array(sorted(pairs)), roughly=True)
                )
                continue
            if known is not None and not there > value:
                return known
            if far < room and not held_back(bodies, cuts, x, touching):
                return end
            # A row of where it came from is in the way, and no body.
            known, value, start = end, there, end.q
            cuts, room, met = self.near(setting, start), np.inf, set()
        return replace(end, converged=False, status="Collision") if known is None else known

    def _followed(
        self,
        setting: Setting,
        end: LocalSolve,
        numbers: Array,
        beside: Array,
        bounds: tuple[Array, Array],
    ) -> LocalSolve:
        """Where bodies that a climb has ended at lead it.

        Rows are exact to first order where their points are witnesses: from there they are made
        anew until that gains nothing.
        """
        bodies = setting.bodies
        assert bodies is not None
        value = self.objectives(setting, end.q[None])[0]
        for _ in range(_COLLISIONS):
            x = setting.configurations(self.split(end.q[None]))[0]
            if not bodies.witnesses(x, bodies.clearance + TOUCHING):
                break
            cuts = self.near(setting, end.q)
            found = self._run(setting, cuts, end.q, numbers, beside, bounds, EXACT - SPARE)
            gain = self.objectives(setting, found.q[None])[0] - value
            if not (found.converged and gain > 0 and self.clear(setting, found.q[None])[0]):
                break
            end, value = found, value + gain
            if gain < _GAIN:
                break
        return end

    def near(self, setting: Setting, q: Array) -> tuple[Witness, ...]:
        """Bodies that matter to a program that starts at a posture, (N,), the nearest first."""
        near = of_two(self._witnesses(setting, q, MATTERS))
        return near or of_two(self._witnesses(setting, q, _FARTHER, roughly=True))[:ROWS]

    def runs_into(self, setting: Setting, q: Array) -> tuple[Witness, ...]:
        """Bodies that a program has let come too near at its end, (N,)."""
        return self._witnesses(setting, q, 0.0)

    def _witnesses(
        self, setting: Setting, q: Array, beyond: float, *, roughly: bool = False
    ) -> tuple[Witness, ...]:
        bodies = setting.bodies
        if bodies is None:
            return ()
        x = setting.configurations(self.split(q[None]))[0]
        return tuple(bodies.witnesses(x, bodies.clearance + beyond, roughly=roughly))

    def apart(self, cuts: Sequence[Sequence[Witness]]) -> Apart | None:
        """Rows of a program that keep bodies apart, enough for any of some postures."""
        return None if self.bodies is None else Apart.of(self.bodies, cuts)

    def kept_apart(
        self, apart: Apart | None, cuts: Sequence[Witness], margin: float = 0.0
    ) -> Array:
        """The parameters of these rows, with so much more than the clearance, m."""
        if apart is None or self.bodies is None:
            return np.zeros(0)
        return apart.given(self.bodies, cuts, margin)

    def _run(
        self,
        setting: Setting,
        cuts: Sequence[Witness],
        start: Array,
        numbers: Array,
        beside: Array,
        bounds: tuple[Array, Array],
        margin: float = 0.0,
    ) -> LocalSolve:
        if not np.all(np.isfinite(beside)):
            return LocalSolve(start, False, "Singular_Start", {})
        apart = self.apart([cuts])
        given = np.concatenate([numbers, self.kept_apart(apart, cuts, margin)])
        place = Given(setting.cell.parameters, given, beside)
        return self.built(None, apart).solve(start, [place], *bounds)

    def given(
        self, setting: Setting, q: Array, demands: Sequence[Sequence[Demand]] | None
    ) -> tuple[list[Array], Array]:
        """Numbers of programs that start at postures, (count, N), and where what they have beside
        the joints starts, (count, v); not finite where that cannot be said.
        """
        objective, holding = setting.objective, setting.holding
        numbers, beside = [setting.numbers] * len(q), [np.zeros((len(q), 0))]
        if self.capacity is not None and holding is not None:
            parts = self.split(q)
            if isinstance(objective, LimitsMeasure) and demands is not None:
                numbers = [objective.numbers(wanted) for wanted in demands]
                beside.append(objective.starts(self.capacity, holding, parts, demands))
            if self.static:
                beside.append(self.capacity.resting(holding, parts))
        return numbers, np.hstack(beside)

    def demands(self, setting: Setting, q: Array) -> list[tuple[Demand, ...]]:
        """What counts of an objective's demands at postures, (count, N)."""
        objective, holding = setting.objective, setting.holding
        assert isinstance(objective, LimitsMeasure)
        assert self.capacity is not None and holding is not None
        return objective.nearest(self.capacity, setting.cell, holding, self.split(q))

    def tightened(
        self, setting: Setting, q: Array, demands: Sequence[Demand]
    ) -> tuple[Demand, ...] | None:
        """See `LimitsMeasure.tightened`, at a posture, (1, N)."""
        objective, holding = setting.objective, setting.holding
        assert isinstance(objective, LimitsMeasure)
        assert self.capacity is not None and holding is not None
        return objective.tightened(self.capacity, setting.cell, holding, self.split(q), demands)

    @cached_property
    def links(self) -> tuple[LinkRecord, ...]:
        """Outlines of the arms' links; none where a robot's shapes cannot be read."""
        try:
            return link_records(self.scene.solids, self.cell.arms, planar=self.scene.planar)
        except InputError:
            return ()

    def measure(
        self, setting: Setting, joints: Sequence[Array], *, everything: bool = False
    ) -> Measurement:
        """A posture as it is reported, by arm (n_i,), see `Meter.measure`."""
        cell = setting.cell
        meter = self.meter.toward(setting.objective)
        measured = meter.measure(cell, joints, everything=everything)
        if self.bodies is None:
            return measured
        return with_collision(cell, measured, self.bodies)

    def overlap(self, cell: Cell, joints: Sequence[Array]) -> tuple[str, ...]:
        """A note where bodies overlap at a posture, by arm (n_i,), that nothing keeps apart."""
        if self.bodies is not None:
            return ()
        try:
            return overlap_notes(cell, self.every_body, joints)
        except InputError:
            # Robots without shapes are no fault where none is asked for.
            return ()

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
        share = self.shares(setting, np.hstack(q)) if self.static else None
        return Measures(self._objectives(setting, q, grams), grams, errors, share)
