"""The sparse program of a motion over all its knots, for IPOPT.

    min  −aggregate + smoothness · S   over the joints at every knot,

subject to what must hold at each knot, to speed limits between neighbours, and to what ties the
knots' other variables to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from copose.motion.nlp.callbacks import Evaluated
from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.nlp.knot import KnotNlp, MotionKind
from copose.motion.nlp.linear_rows import motion_rows
from copose.motion.nlp.motion_functions import MotionFunctions
from copose.poses import Array, Mask
from copose.posture.solvers.ipopt import Ipopt
from copose.posture.solvers.nlp import ipopt_options


@dataclass(frozen=True)
class MotionProgramOptions:
    """Options of a motion's program and of IPOPT."""

    tolerance: float = 1e-8  # IPOPT's
    barrier: float = 1e-2  # first barrier parameter
    plain_barrier: float = 1e-4  # the same where joints alone vary
    shortest_tolerance: float = 1e-6  # of the shortest duration, and its barrier from a start near
    shortest_barrier: float = 1e-3  # the answer: many limits make a motion long with a larger one
    near_barrier: float = 1e-5  # the same from a start near the answer,
    near_push: float = 1e-7  # which is put so far inside its bounds
    warm_barrier: float = 1e-6  # the same with multipliers of a neighbouring program's answer,
    warm_push: float = 1e-9  # which is put so far inside its bounds
    smoothing: float = 1e-6  # cost of S over the squared duration where the objective counts not
    least_stretch: float = 1e-6  # lower bound of the stretch of the duration

    def ipopt(self, *, shortest: bool, near: bool, warm: bool, plain: bool) -> dict[str, Any]:
        """Options of IPOPT near the answer, with known multipliers, or where joints alone vary."""
        options = ipopt_options() | {
            "no_nlp_grad": True,
            "ipopt.tol": self.shortest_tolerance if shortest else self.tolerance,
            "ipopt.mu_init": self.barrier,
        }
        pushes = ["bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"]
        if warm:
            options |= {"ipopt.mu_init": self.warm_barrier, "ipopt.warm_start_init_point": "yes"}
            pushes.append("mult_bound_push")
            options |= {f"ipopt.warm_start_{push}": self.warm_push for push in pushes}
        elif near and shortest:
            options |= {"ipopt.mu_init": self.shortest_barrier}
        elif near:
            options |= {"ipopt.mu_init": self.near_barrier}
            options |= {f"ipopt.{push}": self.near_push for push in pushes}
        elif plain:
            multipliers = {"ipopt.bound_mult_init_method": "mu-based"}
            options |= {"ipopt.mu_init": self.plain_barrier} | multipliers
        return options


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of an answer: of its variables' bounds, and of all constraints but clearance."""

    bounds: Array
    constraints: Array


@dataclass(frozen=True, eq=False)
class MotionInputs:
    """Inputs of a motion's program."""

    parameters: Array  # of every knot, see `KnotNlp`, (n, p)
    duration: float  # s; where the shortest is sought, the one that its stretch multiplies
    smoothness: float  # s²/rad² per unit of the objective
    lower: Array  # of the joints at every knot, (n, N); ``upper`` alike
    upper: Array
    speeds: Array  # limits of the joints, (N,)
    held: Mask  # at which knots the object is held at rest, where the program has that, (n,)
    clearance: ClearanceRows | None = None  # rows that keep bodies apart
    # What is left of each constraint's bounds at every knot, as a part, (n, g); None where nothing
    # was taken away.
    tightened: Array | None = None
    returns: bool = False  # whether the last knot is the first
    # Multipliers of a neighbouring program's answer, where it starts.
    warm: Multipliers | None = None
    near: bool = False  # whether it starts near its answer
    iterations: int = 300  # at most


@dataclass(frozen=True, eq=False)
class OptimisedMotion:
    """A motion that a program ended with."""

    q: Array  # joints at the knots, (n, N)
    duration: float  # s
    converged: bool  # whether it is an answer: IPOPT met its tolerance
    status: str  # in IPOPT's words
    # The constraint that is broken most, at which knot, by how much.
    violated: tuple[str, int, float]
    multipliers: Multipliers | None = None  # of the program's answer
    # Of torque and acceleration limits, where as little of them as can be is sought.
    share: float | None = None


class MotionProgram:
    """The program of one kind over all knots of a motion, for certain inputs."""

    def __init__(
        self,
        task: KnotNlp,
        inputs: MotionInputs,
        options: MotionProgramOptions = MotionProgramOptions(),
    ) -> None:
        """Lay out the program."""
        self._task, self._inputs, self._options = task, inputs, options
        self._count, self._size, self._joints = len(inputs.parameters), task.size, task.joints
        smoothing = inputs.smoothness / inputs.duration**2
        if task.kind in (MotionKind.SHORTEST, MotionKind.SPARING):
            # Joints are to have one way to go.
            smoothing = options.smoothing
        self._linear = motion_rows(
            task, self._count, inputs.speeds, inputs.duration, returns=inputs.returns
        )
        # S is the mean of (Δq/Δt)² over the intervals and the joints.
        self._low, self._high = self._knot_bounds()
        self._counted = np.isfinite(self._low) | np.isfinite(self._high)
        self._functions = MotionFunctions(
            task, inputs.parameters, self._counted, self._linear, inputs.clearance,
            smoothing * (self._count - 1) / self._joints,
        )  # fmt: skip
        self._spaced = 0 if inputs.clearance is None else len(inputs.clearance)

    def solve(self, start: Array) -> OptimisedMotion:
        """One run of IPOPT.

        Args:
            start: of the variables of every knot, (n, ny).
        """
        inputs, slices = self._inputs, self._task.slices
        lower, upper = self._variable_bounds()
        tied, spaced = self._linear, np.zeros(self._spaced)
        low = np.concatenate([self._low[self._counted], tied.lower, spaced])
        high = np.concatenate([self._high[self._counted], tied.upper, spaced + np.inf])
        known = {}
        if inputs.warm is not None:
            multipliers = np.concatenate([inputs.warm.constraints, np.zeros(self._spaced)])
            known = {"lam_x0": inputs.warm.bounds, "lam_g0": multipliers}
        nlp = self._solver()
        answer = nlp(
            x0=start.ravel(), lbx=lower.ravel(), ubx=upper.ravel(), lbg=low, ubg=high, **known
        )
        values, status = np.array(answer["g"]).ravel(), str(nlp.stats()["return_status"])
        excess = np.maximum(np.maximum(low - values, values - high), 0.0)
        worst = int(np.nan_to_num(excess, nan=np.inf).argmax())
        y = np.array(answer["x"]).reshape(self._count, self._size)
        multipliers = np.array(answer["lam_g"]).ravel()
        shared = {name: float(y[0, slices[name].start]) for name in ("stretch", "share")
                  if name in slices}  # fmt: skip
        return OptimisedMotion(
            q=np.clip(y[:, : self._joints], inputs.lower, inputs.upper),
            duration=inputs.duration * shared.get("stretch", 1.0),
            converged=status == "Solve_Succeeded",
            status=status,
            violated=(*self._name(worst), float(excess[worst])),
            multipliers=Multipliers(
                np.array(answer["lam_x"]), multipliers[: len(multipliers) - self._spaced]
            ),
            share=shared.get("share"),
        )

    def _variable_bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables of every knot, (n, ny) each."""
        inputs, slices = self._inputs, self._task.slices
        lower = np.full((self._count, self._size), -np.inf)
        upper = np.full((self._count, self._size), np.inf)
        lower[:, : self._joints], upper[:, : self._joints] = inputs.lower, inputs.upper
        if "stretch" in slices:
            # Accelerations do not tell time from its opposite.
            lower[:, slices["stretch"]] = self._options.least_stretch
        if "hold" in slices:
            lower[~inputs.held, slices["hold"]] = 0.0
            upper[~inputs.held, slices["hold"]] = 0.0
        return lower, upper

    def _knot_bounds(self) -> tuple[Array, Array]:
        """Bounds of the constraints of every knot, (n, g) each."""
        low, high = self._task.bounds
        lows, highs = (np.tile(bound, (self._count, 1)) for bound in (low, high))
        # Where every joint of an arm is given its closure is no equation for anything.
        fixed = self._inputs.lower == self._inputs.upper
        first = 0
        for constraint in self._task.constraints:
            rows = slice(first, first + constraint.expression.numel())
            first = rows.stop
            if constraint.name in self._task.holding:
                lows[~self._inputs.held, rows], highs[~self._inputs.held, rows] = -np.inf, np.inf
            columns = self._task.moved_by.get(constraint.name)
            if columns is not None:
                known = fixed[:, columns].all(axis=1)
                lows[known, rows], highs[known, rows] = -np.inf, np.inf
        if self._inputs.tightened is not None:
            lows *= self._inputs.tightened
            highs *= self._inputs.tightened
        return lows, highs

    def _name(self, row: int) -> tuple[str, int]:
        """The constraint that a row belongs to, and its knot."""
        counted = np.argwhere(self._counted)
        if row >= len(counted):
            row -= len(counted)
            if row < len(self._linear.names):
                return self._linear.names[row]
            assert self._inputs.clearance is not None
            return "clearance", int(self._inputs.clearance.knots[row - len(self._linear.names)])
        k, row = counted[row].tolist()
        for constraint in self._task.constraints:
            if row < constraint.expression.numel():
                return constraint.name, k
            row -= constraint.expression.numel()
        return "", k

    def _solver(self) -> Ipopt:
        functions, inputs, dense = self._functions, self._inputs, ca.Sparsity.dense
        width, height = self._size * self._count, functions.height
        x, p, lam = ("x", width), ("p", 0), ("lam_g", height)
        f, g = ("f", dense(1)), ("g", dense(height))
        # CasADi keeps no reference of its own to Python's callbacks.
        self._callbacks = {
            "grad_f": Evaluated(
                "nlp_grad_f", [x, p], [f, ("grad_f_x", dense(width))], functions.gradient
            ),
            "jac_g": Evaluated(
                "nlp_jac_g", [x, p], [g, ("jac_g_x", functions.jacobian_pattern)],
                functions.jacobian,
            ),
            "hess_lag": Evaluated(
                "nlp_hess_l", [x, p, ("lam_f", 1), lam],
                [("triu_hess_gamma_x_x", functions.hessian_pattern)], functions.hessian,
            ),
        }  # fmt: skip
        self._oracle = Evaluated("nlp", [x, p], [f, g], functions.values)
        options = self._options.ipopt(
            shortest=self._task.shared == "stretch",
            near=inputs.near,
            warm=inputs.warm is not None,
            plain=self._size == self._joints,
        )
        options |= {"ipopt.max_iter": inputs.iterations, **self._callbacks}
        return Ipopt("motion", self._oracle, (width, 0, height), options)
