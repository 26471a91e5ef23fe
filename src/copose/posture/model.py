"""Kernels and programs of a cell, built once; object pose, mass and limits are numbers."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from copose import kernels
from copose.capability import Sums
from copose.cell.cell import Cell
from copose.cell.dynamics import CellDynamics
from copose.cell.freedom import Freedom
from copose.cell.variables import Places
from copose.collision import Bodies, Scene
from copose.constraints.clearance import Apart
from copose.constraints.posture_constraint import PostureConstraint
from copose.constraints.registry import constraints_of
from copose.errors import InputError
from copose.measurement.collision import noted, overlap_notes, with_collision
from copose.measurement.meter import Measurement, Measures, Meter, closure_errors
from copose.objectives.objective import Objective
from copose.objectives.registry import objective_of
from copose.poses import Array
from copose.posture.feasibility import Feasibility
from copose.posture.score import Score
from copose.posture.setting import Setting
from copose.posture.solvers.active_set import NewtonOptions
from copose.posture.solvers.newton import ArmGroup, Polisher
from copose.posture.solvers.placed_newton import (
    PlacedArm,
    PlacedCase,
    PlacedKernels,
    PlacedPolisher,
    Variables,
)
from copose.results import LinkRecord, link_records
from copose.self_motion.kernels import ArmKernels, KernelInputsBuilder, terms_kernel
from copose.self_motion.manifold import ClosureManifold

if TYPE_CHECKING:
    from copose.posture.solvers.nlp import PostureProgram


class PostureModel:
    """Expressions, kernels and programs of a cell; object pose, mass and limits are numbers.

    Attributes:
        cell: as the file has it.
        objective: what is maximised.
        arms: kernels by arm; arms of one model share them.
        score: of the sums of the arms' terms.
        placed: kernels with everything that is free, where it is more than joints and the score
            can be climbed.
        meter: measures what is reported.
        capacity: what torque limits allow, where they matter.
        feasibility: tests of the constraints.
        bodies: that may not touch, if any.
    """

    def __init__(
        self,
        cell: Cell,
        objective: Objective | None = None,
        constraints: Sequence[PostureConstraint] | None = None,
    ) -> None:
        """Build what a search needs, with an objective or constraints in place of the problem's.

        The posture program follows when it is asked for.
        """
        self.cell = cell
        self.objective: Objective = objective_of(cell) if objective is None else objective
        self._given = objective
        constraints = constraints_of(cell) if constraints is None else tuple(constraints)
        self.feasibility = Feasibility(constraints)
        limited = [self.objective.torque_limited, *(c.torque_limited for c in constraints)]
        self.capacity = CellDynamics(cell, cell.counted_limits) if any(limited) else None
        sums = self.objective.sums
        self.arms = cell.system.by_model(lambda arm: ArmKernels.of(arm, sums))
        self._placer = KernelInputsBuilder(cell.system, sums, self.objective.scales)
        self._ruling_out = [_SummedTerms(cell, c.sums) for c in constraints if c.sums is not None]
        self._nominal = None if self.capacity is None else self.capacity.holding(cell)
        numbers = len(self.objective.parameters(self._nominal))
        self.score = Score(cell, self.objective, numbers, constraints)
        alone = not len(self.places.freedom) and not cell.problem.cases
        placed = not alone and self.objective.summable
        self.placed = PlacedKernels(self.places, self.objective, numbers) if placed else None
        self.meter = Meter(cell, self.objective, self.capacity)
        self.bodies = self.every_body if cell.problem.constraints.collision else None
        self._built: dict[tuple[bool, Apart | None], PostureProgram] = {}
        self._looked: float | None = None
        self._kernels = (
            *(kernel for model in dict.fromkeys(self.arms) for kernel in model.all),
            *(kernel for terms in self._ruling_out for kernel in terms.kernels),
            *self.score.all,
            *(() if self.placed is None else self.placed.all),
            self._placer.kernel,
            *(() if self.capacity is None else self.capacity.kernels),
        )

    @cached_property
    def scene(self) -> Scene:
        """All bodies, and which of them may not touch.

        Raises:
            InputError: an arm has no shape.
        """
        return Scene.of(self.cell.problem, self.cell.arms)

    @cached_property
    def every_body(self) -> Bodies:
        """The bodies as they are asked for distances."""
        return self.scene.bodies(self.cell.arms, self.cell.problem.constraints.clearance)

    @property
    def program(self) -> PostureProgram:
        """The posture program, for IPOPT."""
        return self.built(None, None)

    @cached_property
    def places(self) -> Places:
        """Coordinates that are free beside the joints, for all cases."""
        cases = tuple(case.name for case in self.cell.problem.cases) or ("",)
        return Places(self.cell, Freedom.of(self.cell.problem), cases)

    def built(self, places: Places | None, apart: Apart | None) -> PostureProgram:
        """The posture program, with all cases and everything that is free where ``places`` are
        given, and with rows that keep bodies apart.
        """
        key = places is not None, apart
        if key not in self._built:
            system = self.cell.system
            terms = [] if apart is None else [apart.term(system)]
            for constraint in self.feasibility.constraints:
                term = constraint.term(system, self.capacity)
                terms += [] if term is None else [term]
            # Many searches never solve a program.
            from copose.posture.solvers.nlp import PostureProgram

            numbers = self.objective.program_size(self._nominal)
            self._built[key] = PostureProgram(
                self.cell, self.objective, numbers, self.capacity, terms, places
            )
        return self._built[key]

    def compiled(self, *, wait: bool = False, again: float = 0.5) -> bool:
        """True where compiled kernels are in use; what is missing is compiled, see `kernels.build`.

        Args:
            wait: for the compiler to end.
            again: s, after which compiled code is looked for anew.
        """
        if wait or self._looked is None:
            self._looked = time.monotonic()
            return kernels.build(self._kernels, wait=wait)
        # The compiler was set to work once; whether it has ended need not be asked at every call.
        if not self.compiled_already and time.monotonic() > self._looked + again:
            self._looked = time.monotonic()
            for kernel in self._kernels:
                kernel.load()
        return self.compiled_already

    @property
    def compiled_already(self) -> bool:
        """True where compiled kernels are in use."""
        return all(kernel.compiled for kernel in self._kernels)

    def setting(self, cell: Cell) -> Setting:
        """A cell of these arms, for the kernels."""
        placement = self._placer(cell.parameters)
        objective = self.objective
        if self._given is None and cell.problem.objective is not self.cell.problem.objective:
            objective = objective_of(cell)
        holding = None if self.capacity is None else self.capacity.holding(cell)
        numbers = objective.parameters(holding)
        weight = np.zeros(len(cell.system.space.balance)) if holding is None else holding.weight
        given = np.concatenate([placement.inertia, weight, numbers])
        return Setting(
            cell=cell,
            numbers=numbers,
            capacity=self.capacity,
            holding=holding,
            bodies=self.bodies,
            sums=partial(self._sums, placement.ties),
            grams=partial(self._grams, given),
            objective=objective,
            placement=placement,
            given=given,
            lower=self._limits[0],
            upper=self._limits[1],
            ties=tuple(terms.ties(cell) for terms in self._ruling_out),
        )

    def together(self, settings: Sequence[Setting]) -> Setting:
        """Settings as one, in which each of as many postures has its own sums and grams."""
        ties = zip(*(setting.placement.ties for setting in settings), strict=True)
        given = np.array([setting.given for setting in settings])
        sums = partial(self._sums, [np.array(tie) for tie in ties])
        return replace(settings[0], sums=sums, grams=partial(self._grams, given))

    @cached_property
    def _limits(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Lower and upper joint limits by arm, none of joints that can turn all the way, (n_i,)."""
        cell = self.cell
        turns = [cell.turns(i) for i in range(len(cell.arms))]
        lower = (np.where(t, -np.inf, low) for t, low in zip(turns, cell.lower, strict=True))
        upper = (np.where(t, np.inf, high) for t, high in zip(turns, cell.upper, strict=True))
        return tuple(lower), tuple(upper)

    def _sums(self, ties: Sequence[Array], q: Sequence[Array]) -> Array:
        """Sums of the arms' terms, (count, s), of postures by arm, (count, n_i)."""
        arms = zip(self.arms, q, ties, strict=True)
        return np.asarray(sum(arm.terms(q_i, tie) for arm, q_i, tie in arms))

    def _grams(self, given: Array, sums: Array) -> Array:
        """G of sums, (count, s), as it is optimised, (count, a, a)."""
        assert self.score.gram is not None
        entries = self.score.gram(sums, given)
        a = len(self.cell.problem.axes)
        grams = np.empty((len(entries), a, a))
        rows, columns = np.triu_indices(a)
        grams[:, rows, columns] = grams[:, columns, rows] = entries
        return grams

    def polisher(
        self, setting: Setting, only: int | None = None, rest: Array | float = 0.0
    ) -> Polisher:
        """An active-set method that climbs the score in a setting.

        One arm may move alone; ``rest`` is what the others then add to the sums, (s,).
        """
        place, groups = setting.placement, []
        every = range(len(self.arms)) if only is None else [only]
        edges = np.cumsum([0] + [self.arms[i].n for i in every])
        moving = [i for i in every if not setting.cell.arms[i].fixed]
        edges = edges[[every.index(i) for i in moving]]
        for i in every:
            if i not in moving:
                start = np.asarray(setting.cell.arms[i].start)[None]
                rest = rest + self.arms[i].terms(start, place.ties[i])[0]
        for kernels_ in dict.fromkeys(self.arms[i] for i in moving):
            members = [(i, edge) for i, edge in zip(moving, edges, strict=True)
                     if self.arms[i] is kernels_]  # fmt: skip
            groups.append(
                ArmGroup(
                    kernels=kernels_,
                    columns=np.array([edge + np.arange(kernels_.n) for _, edge in members]),
                    goals=np.array([place.goals[i] for i, _ in members]),
                    ties=np.array([place.ties[i] for i, _ in members]),
                    lower=np.array([setting.lower[i] for i, _ in members]),
                    upper=np.array([setting.upper[i] for i, _ in members]),
                )
            )
        return Polisher(groups, NewtonOptions(), self.score, setting.given, rest)

    def placed_polisher(
        self, settings: Sequence[Setting], weights: Sequence[float]
    ) -> PlacedPolisher:
        """An active-set method over everything that is free, in all cases as the file has them."""
        assert self.placed is not None
        places, cell = self.places, self.cell
        arms = zip(self.arms, self.placed.arms, self.objective.scales, strict=True)
        joints = len(settings) * cell.system.q.numel()
        free = places.parted(np.arange(joints, joints + places.size, dtype=float))
        cases = [
            PlacedCase(
                places.freedom.numbers(setting.cell),
                setting.given[len(setting.placement.inertia) :],
                weight,
                columns.astype(np.intp),
            )
            for setting, weight, columns in zip(settings, weights, free, strict=True)
        ]
        bounds = zip(*(setting.bounds for setting in settings), places.bounds, strict=True)
        limits = Variables.of(*(np.concatenate(ends) for ends in bounds))
        placed = [PlacedArm(*arm) for arm in arms]
        options = NewtonOptions(iterations=30)
        return PlacedPolisher([limits], options, self.placed, placed, cases)

    def manifold(self, setting: Setting, i: int) -> ClosureManifold:
        """Closed postures of arm i within its limits."""
        goal, turns = setting.placement.goals[i], setting.cell.turns(i)
        limits = setting.lower[i][None], setting.upper[i][None]
        return ClosureManifold(self.arms[i], goal[None], *limits, turns[None])

    def terms(self, setting: Setting, i: int, q: Array) -> Array:
        """Terms of arm i in the sums by which postures are compared, (count, s), at (count, n)."""
        own = self.arms[i].terms(q, setting.placement.ties[i])
        ruling_out = zip(self._ruling_out, setting.ties, strict=True)
        return np.hstack([own, *(terms.by_arm[i](q, ties[i]) for terms, ties in ruling_out)])

    def objectives(self, setting: Setting, q: Array) -> Array:
        """The objective at postures, (count, N); NaN or −inf where there is none, (count,)."""
        return setting.objective.values(setting, self.split(q))

    def estimates(self, setting: Setting, q: Array) -> Array:
        """The objective at postures, (count, N), or a bound of it that is quicker."""
        return setting.objective.estimates(setting, self.split(q))

    def split(self, q: Array) -> list[Array]:
        """Stacked postures, (count, N), arm by arm."""
        return self.cell.system.split(q)

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
        if self.bodies is not None:
            measured = with_collision(cell, measured, self.bodies)
        return noted(measured, self.feasibility.constraints)

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
        """Measured values of postures, by arm (count, n_i)."""
        space = setting.cell.system.space
        errors = {}
        arms = zip(setting.cell.arms, self.arms, q, setting.placement.goals, strict=True)
        for arm, kernels_, q_i, goal in arms:
            gaps = kernels_.gap(q_i, goal)
            errors[arm.name] = closure_errors(gaps[:, list(space.linear)], gaps[:, 3:], space.rigid)
        values, grams = setting.objective.values_and_grams(setting, q)
        shares = [constraint.shares(setting, q) for constraint in self.feasibility.constraints]
        share = next((share for share in shares if share is not None), None)
        return Measures(values, grams, errors, share)


class _SummedTerms:
    """The terms of arms in the sums of a constraint, by kernels of their own.

    Attributes:
        kernels: by model.
        by_arm: the same by arm.
    """

    def __init__(self, cell: Cell, sums: Sums) -> None:
        """Write it down."""
        self.by_arm = cell.system.by_model(lambda arm: terms_kernel(arm, sums))
        self.kernels = tuple(dict.fromkeys(self.by_arm))
        self._placer = KernelInputsBuilder(cell.system, sums, cell.counted_limits)

    def ties(self, cell: Cell) -> tuple[Array, ...]:
        """Inputs of the kernels where the object is, by arm."""
        return self._placer(cell.parameters).ties
