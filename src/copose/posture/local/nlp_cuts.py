"""Posture programs with constraint generation: solve, add what is violated, solve again.

A program leaves out most demands of an objective that torque limits decide and most pairs of
bodies. Those that its end violates join the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from copose.collision import Witness
from copose.constraints.clearance import SPARE, Apart, held_back, of_two, rows_of
from copose.objectives.objective import Cuts
from copose.poses import Array
from copose.posture.model import PostureModel
from copose.posture.optimum import LocalSolve
from copose.posture.setting import Setting
from copose.posture.solvers.constraint_generation import GenerationOptions, ProgramEnd, generate
from copose.posture.solvers.nlp import Given
from copose.progress import stage


@dataclass(frozen=True)
class CutOptions:
    """Bounds on how often programs are solved again, and how far they may go."""

    generation: GenerationOptions = field(default_factory=GenerationOptions)  # of demands
    loss: float = 1e-9  # what a climb may lose by rounding, relative

    collisions: int = 12  # programs with what they have run into, at most
    near: float = 0.01  # m beyond the clearance, bodies that matter to a program
    far: float = 0.1  # m, those that matter where there are none
    fewest: int = 8  # of the latter, at most
    touching: float = 3 * SPARE  # m beyond the clearance that counts as touching
    exact: float = 1e-8  # m, what rows keep whose points are witnesses of where a program ends
    near_best: float = 3e-5  # what comes so near the best, relative, is followed along bodies
    gain: float = 1e-6  # what following has to gain: the next gain is of the order of the square
    hope: float = 3.0  # times what the best has gained, that others may be below it


@dataclass(frozen=True, eq=False)
class NlpCuts:
    """Runs of IPOPT from postures, until nothing that counts was left out."""

    model: PostureModel
    options: CutOptions = CutOptions()

    def solve(self, setting: Setting, q: Array) -> Iterator[LocalSolve]:
        """Ends of local solves from postures, (count, N)."""
        objective, model = setting.objective, self.model
        if all(arm.fixed for arm in setting.cell.arms):
            # IPOPT refuses a program without freedom, in which each posture is its own optimum.
            for start, allowed in zip(q, self.model.feasibility.allowed(setting, q), strict=True):
                yield LocalSolve(start, bool(allowed), "Fixed", {}, 0.0)
            return
        cuts = objective.cuts(setting, model.split(q))
        if objective.costly:
            for start, own in zip(q, cuts, strict=True):
                yield self._exchanged(setting, start, own)
            return
        ends = self._programs(setting, q, cuts)
        if not objective.piecewise:
            yield from ends
            return
        values = model.objectives(setting, np.array([end.q for end in ends]))
        lost = ~(values >= model.objectives(setting, q) - self.options.loss * (1 + np.abs(values)))
        for start, end, own, left in zip(q, ends, cuts, lost, strict=True):
            # It has left for a worse optimum, or failed.
            yield self._exchanged(setting, start, own) if left else end

    def _exchanged(self, setting: Setting, start: Array, cuts: Cuts) -> LocalSolve:
        """Programs until no demand is left out, each better than the one before."""
        objective, model, generation = setting.objective, self.model, self.options.generation
        lower, upper = setting.bounds

        def solve(
            origin: LocalSolve, cuts: Cuts, room: float
        ) -> ProgramEnd[LocalSolve, Cuts] | None:
            box = np.maximum(lower, origin.q - room), np.minimum(upper, origin.q + room)
            end = self._programs(setting, origin.q[None], [cuts], box)[0]
            if not end.converged:
                return None
            parts = model.split(end.q[None])
            value = objective.values(setting, parts)[0]
            violated = objective.more_cuts(setting, parts, cuts)
            return ProgramEnd(end, value, float(np.abs(end.q - origin.q).max()), violated)

        def accepts(step: ProgramEnd[LocalSolve, Cuts], best: float, accepted: bool) -> bool:
            still = not accepted and step.way < generation.smallest_box
            return step.value > best or (still and step.cuts is None)

        failed = LocalSolve(start, False, "Singular_Start", {})
        return generate(failed, self._value(setting, start), cuts, solve, accepts, generation)

    def _programs(
        self,
        setting: Setting,
        q: Array,
        cuts: Sequence[Cuts],
        bounds: tuple[Array, Array] | None = None,
    ) -> list[LocalSolve]:
        """One program from each posture, (count, N), with as many as clear bodies take.

        What ends touching bodies and near the best is followed along them.
        """
        bounds = setting.bounds if bounds is None else bounds
        numbers, starts = self.given(setting, q, cuts)
        ends, best = [], -np.inf
        for k, start in enumerate(q):
            stage("polishing", k, len(q))
            run = partial(self._run, setting, numbers[k], starts[k])
            ends.append(self._climb(run, setting, start, bounds, best))
            if ends[k].converged:
                best = max(best, self._value(setting, ends[k].q))
        if setting.bodies is None:
            return ends
        values = self.model.objectives(setting, np.array([end.q for end in ends]))
        most = self.options.near_best * max(1.0, abs(best))
        for k in np.argsort(-values, kind="stable"):
            if ends[k].converged and not values[k] < best - most:
                run = partial(self._run, setting, numbers[k], starts[k])
                ends[k] = self._followed(run, setting, ends[k], bounds)
                value = self._value(setting, ends[k].q)
                # What the best has gained says how much others may.
                best, most = max(best, value), min(most, self.options.hope * (value - values[k]))
        return ends

    def _climb(
        self,
        run: Callable[..., LocalSolve],
        setting: Setting,
        start: Array,
        bounds: tuple[Array, Array],
        best: float,
    ) -> LocalSolve:
        """A program from a posture, (N,), or as many as it takes to keep bodies apart.

        Rows hold at every start, so that no program is without a feasible point.
        """
        bodies, known, value = setting.bodies, None, -np.inf
        rows, room, met = self.near(setting, start), np.inf, set[int]()
        least = best - self.options.near_best * max(1.0, abs(best))
        for _ in range(self.options.collisions):
            box = np.maximum(bounds[0], start - room), np.minimum(bounds[1], start + room)
            end = run(rows, start, box)
            if not end.converged:
                return end if known is None else known
            reached = self._value(setting, end.q)
            if bodies is None:
                return end
            # Where a run is dear: what keeps clear of more will hardly be better.
            if self.model.capacity is not None and known is None and not reached > best:
                return replace(end, converged=False, status="Below_Best")
            before, x = setting.configurations(self.model.split(np.array([start, end.q])))
            touching = bodies.witnesses(x, bodies.clearance + self.options.touching)
            hits = [witness for witness in touching if witness.distance < bodies.clearance]
            far = np.abs(end.q - start).max()
            if hits:
                if known is None and reached < least:
                    return replace(end, converged=False, status="Below_Best")
                # What it has run into joins the pairs that matter; where that has not been enough
                # it may go half as far.
                pairs = {witness.pair for witness in hits}
                if pairs & met:
                    room = far / 2
                met |= pairs
                hold = rows_of(bodies, hits, before) >= bodies.clearance + SPARE
                rows += tuple(hit for hit, holds in zip(hits, hold, strict=True) if holds)
                rows += tuple(
                    bodies.witnesses(before, np.inf, np.array(sorted(pairs)), roughly=True)
                )
                continue
            if known is not None and not reached > value:
                return known
            if far < room and not held_back(bodies, rows, x, touching):
                return end
            # A row of where it came from is in the way, and no body.
            known, value, start = end, reached, end.q
            rows, room, met = self.near(setting, start), np.inf, set()
        return replace(end, converged=False, status="Collision") if known is None else known

    def _followed(
        self,
        run: Callable[..., LocalSolve],
        setting: Setting,
        end: LocalSolve,
        bounds: tuple[Array, Array],
    ) -> LocalSolve:
        """A climb that goes on along the bodies at which it has ended.

        Rows are exact to first order where their points are witnesses: from there they are made
        anew until that gains nothing.
        """
        bodies = setting.bodies
        assert bodies is not None
        value = self._value(setting, end.q)
        for _ in range(self.options.collisions):
            x = setting.configurations(self.model.split(end.q[None]))[0]
            if not bodies.witnesses(x, bodies.clearance + self.options.touching):
                break
            rows = self.near(setting, end.q)
            following = run(rows, end.q, bounds, self.options.exact - SPARE)
            gain = self._value(setting, following.q) - value
            better = following.converged and gain > 0
            if not (better and self.model.feasibility.clear(setting, following.q[None])[0]):
                break
            end, value = following, value + gain
            if gain < self.options.gain:
                break
        return end

    def _value(self, setting: Setting, q: Array) -> float:
        """The objective at one posture, (N,)."""
        value: float = self.model.objectives(setting, q[None])[0]
        return value

    def near(self, setting: Setting, q: Array) -> tuple[Witness, ...]:
        """Bodies that matter to a program that starts at a posture, (N,), the nearest first."""
        near = of_two(self.witnesses(setting, q, self.options.near))
        if near:
            return near
        far = self.witnesses(setting, q, self.options.far, roughly=True)
        return of_two(far)[: self.options.fewest]

    def witnesses(
        self, setting: Setting, q: Array, beyond: float = 0.0, *, roughly: bool = False
    ) -> tuple[Witness, ...]:
        """Bodies nearer than the clearance, and so much beyond, at a posture, (N,)."""
        bodies = setting.bodies
        if bodies is None:
            return ()
        x = setting.configurations(self.model.split(q[None]))[0]
        return tuple(bodies.witnesses(x, bodies.clearance + beyond, roughly=roughly))

    def apart(self, rows: Sequence[Sequence[Witness]]) -> Apart | None:
        """Rows of a program that keep bodies apart, enough for any of some postures."""
        return None if self.model.bodies is None else Apart.of(self.model.bodies, rows)

    def kept_apart(
        self, apart: Apart | None, rows: Sequence[Witness], margin: float = 0.0
    ) -> Array:
        """The parameters of these rows, with so much more than the clearance, m."""
        if apart is None or self.model.bodies is None:
            return np.zeros(0)
        return apart.given(self.model.bodies, rows, margin)

    def _run(
        self,
        setting: Setting,
        numbers: Array,
        variables: Array,
        rows: Sequence[Witness],
        start: Array,
        bounds: tuple[Array, Array],
        margin: float = 0.0,
    ) -> LocalSolve:
        """One run of IPOPT.

        Args:
            setting: where the object is.
            numbers: parameters of the objective.
            variables: where those beside the joints start.
            rows: bodies that are kept apart.
            start: joints, (N,).
            bounds: of the joints.
            margin: what bodies keep beyond the clearance, m.
        """
        if not np.all(np.isfinite(variables)):
            return LocalSolve(start, False, "Singular_Start", {})
        apart = self.apart([rows])
        given = np.concatenate([numbers, self.kept_apart(apart, rows, margin)])
        place = Given(setting.cell.parameters, given, variables)
        return self.model.built(None, apart).solve(start, [place], *bounds)

    def given(self, setting: Setting, q: Array, cuts: Sequence[Cuts]) -> tuple[list[Array], Array]:
        """Numbers of programs that start at postures, (count, N), and where what they have beside
        the joints starts, (count, v); not finite where that cannot be said.
        """
        objective, parts = setting.objective, self.model.split(q)
        starts = [objective.starts(setting, parts, cuts)]
        starts += [c.starts(setting, parts) for c in self.model.feasibility.constraints]
        return [objective.program_numbers(setting, own) for own in cuts], np.hstack(starts)
