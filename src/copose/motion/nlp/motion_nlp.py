"""One sparse program over all knots of a motion, for IPOPT.

    min  −aggregate + smoothness · S   over the joints at every knot,

subject to what must hold at each knot, to speed limits between neighbours, and to what ties the
knots' other variables to them. All that is nonlinear is a knot's own; knots meet in linear rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from copose.motion.nlp.callbacks import Evaluated
from copose.motion.nlp.clearance_rows import ClearanceRows
from copose.motion.nlp.knot import Form, KnotNlp
from copose.motion.nlp.linear_rows import Builder, LinearRows
from copose.poses import Array, Indices, Mask
from copose.posture.solvers.ipopt import Ipopt
from copose.posture.solvers.nlp import ipopt_options

_STEP = 1e-7
_STEP_AT, _KNOTS_AT, _SHRINKS = 0.35, 25, 0.6
# What is left at least of the duration that the shortest is sought from.
_LEAST = 1e-6
# How much a motion is smoothed whose objective does not count, per square of the duration, so that
# joints have one way to go.
_CALM = 1e-6
_OPTIONS = ipopt_options() | {
    "no_nlp_grad": True,
    "ipopt.tol": 1e-8,
    "ipopt.mu_init": 1e-2,
}
_NEAR: dict[str, object] = {
    "ipopt.mu_init": 1e-5,
    "ipopt.bound_push": 1e-7,
    "ipopt.bound_frac": 1e-7,
    "ipopt.slack_bound_push": 1e-7,
    "ipopt.slack_bound_frac": 1e-7,
}
_WARM: dict[str, object] = {
    "ipopt.mu_init": 1e-6,
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_bound_frac": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_frac": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
}


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Of an answer: of its variables' bounds and of its constraints but those on clearance."""

    bounds: Array
    constraints: Array


@dataclass(frozen=True, eq=False)
class Task:
    """What a program is solved for.

    Attributes:
        parameters: of every knot, see `KnotNlp`, (n, p).
        duration: s; where the shortest is sought, the one that its stretch multiplies.
        smoothness: s²/rad² per unit of the objective.
        lower: of the joints at every knot, (n, N); ``upper`` alike.
        speeds: limits of the joints, (N,).
        held: at which knots the object is held at rest, where the program has that, (n,).
        clearance: rows that keep bodies apart.
        tightened: what is left of each constraint's bounds at every knot, as a part, (n, g); ones
            where nothing was taken away.
        returns: whether the last knot is the first.
        beside: multipliers of a program whose answer is beside this one's, where it starts.
        near: whether it starts near its answer.
        iterations: at most.
    """

    parameters: Array
    duration: float
    smoothness: float
    lower: Array
    upper: Array
    speeds: Array
    held: Mask
    clearance: ClearanceRows | None = None
    tightened: Array | None = None
    returns: bool = False
    beside: Multipliers | None = None
    near: bool = False
    iterations: int = 300


@dataclass(frozen=True, eq=False)
class Solved:
    """How a run ended.

    Attributes:
        y: variables of every knot, (n, ny).
        converged: whether IPOPT met its tolerance.
        status: in its words.
        violated: the constraint that is broken most, at which knot, and by how much.
        multipliers: there.
    """

    y: Array
    converged: bool
    status: str
    violated: tuple[str, int, float]
    multipliers: Multipliers


def longest_step(count: int) -> float:
    """How far a joint may go between two of so many knots, rad or m.

    The chain is closed at knots alone: without this a motion would jump from branch to branch
    between them. With more knots joints may be faster, and jumps are squeezed out.
    """
    return float(_STEP_AT * (_KNOTS_AT / count) ** _SHRINKS)


class MotionProgram:
    """Programs of one form over any number of knots."""

    def __init__(self, task: KnotNlp, form: Form) -> None:
        """Over the knots of a task."""
        self.task, self.form = task, form

    def solve(self, start: Array, given: Task) -> Solved:
        """One run of IPOPT.

        Args:
            start: of the variables of every knot, (n, ny).
            given: what it is solved for.
        """
        return _Run(self.task, self.form, len(start), given).solve(start)


class _Run:
    def __init__(self, task: KnotNlp, form: Form, count: int, given: Task) -> None:
        self._task, self._form, self._count, self._given = task, form, count, given
        self._size, self._joints = task.size, task.joints
        calm = given.smoothness / given.duration**2
        if form.shortest or form.sparing:
            calm = _CALM
        # S is the mean of (Δq/Δt)² over the intervals and the joints.
        self._calm = calm * (count - 1) / self._joints
        self._sign = -1.0 if form.common == "level" else 1.0
        self._links, self._clearance = self._linked(), given.clearance
        self._spaced = 0 if given.clearance is None else len(given.clearance)
        # The solver asks for cost and rows one by one.
        self._known: tuple[Array, list[Array | float]] | None = None
        self._lay_out()

    def solve(self, start: Array) -> Solved:
        count, size, given = self._count, self._size, self._given
        lower = np.full((count, size), -np.inf)
        upper = np.full((count, size), np.inf)
        lower[:, : self._joints], upper[:, : self._joints] = given.lower, given.upper
        if "stretch" in self._task.slices:
            # Accelerations do not tell time from its opposite.
            lower[:, self._task.slices["stretch"]] = _LEAST
        if "hold" in self._task.slices:
            lower[~given.held, self._task.slices["hold"]] = 0.0
            upper[~given.held, self._task.slices["hold"]] = 0.0
        low, high = self._bounds()
        beside, known = given.beside, {}
        if beside is not None:
            multipliers = np.concatenate([beside.constraints, np.zeros(self._spaced)])
            known = {"lam_x0": beside.bounds, "lam_g0": multipliers}
        more = _WARM if beside is not None else _NEAR if given.near else {}
        answer = self._solver(more | {"ipopt.max_iter": given.iterations})(
            x0=start.ravel(), lbx=lower.ravel(), ubx=upper.ravel(), lbg=low, ubg=high, **known
        )
        values, stats = np.array(answer["g"]).ravel(), self._nlp.stats()
        excess = np.maximum(np.maximum(low - values, values - high), 0.0)
        worst = int(np.nan_to_num(excess, nan=np.inf).argmax())
        y = np.array(answer["x"]).reshape(count, size)
        y[:, : self._joints] = np.clip(y[:, : self._joints], given.lower, given.upper)
        multipliers = np.array(answer["lam_g"]).ravel()
        return Solved(
            y=y,
            converged=stats["return_status"] == "Solve_Succeeded",
            status=str(stats["return_status"]),
            violated=(*self._name(worst), float(excess[worst])),
            multipliers=Multipliers(
                np.array(answer["lam_x"]), multipliers[: len(multipliers) - self._spaced]
            ),
        )

    def _bounds(self) -> tuple[Array, Array]:
        low, high = self._task.bounds
        lows, highs = (np.tile(bound, (self._count, 1)) for bound in (low, high))
        # Where every joint of an arm is given its closure is no equation for anything.
        fixed = self._given.lower == self._given.upper
        first = 0
        for constraint in self._task.constraints:
            rows = slice(first, first + constraint.expression.numel())
            first = rows.stop
            if constraint.name in self._task.holding:
                lows[~self._given.held, rows], highs[~self._given.held, rows] = -np.inf, np.inf
            columns = self._task.moved_by.get(constraint.name)
            if columns is not None:
                given = fixed[:, columns].all(axis=1)
                lows[given, rows], highs[given, rows] = -np.inf, np.inf
        if self._given.tightened is not None:
            lows *= self._given.tightened
            highs *= self._given.tightened
        return (
            np.concatenate([lows.ravel(), self._links.lower, np.zeros(self._spaced)]),
            np.concatenate([highs.ravel(), self._links.upper, np.full(self._spaced, np.inf)]),
        )

    def _name(self, row: int) -> tuple[str, int]:
        own = len(self._task.bounds[0])
        if row >= own * self._count:
            row -= own * self._count
            if row < len(self._links.names):
                return self._links.names[row]
            assert self._clearance is not None
            return "clearance", int(self._clearance.knots[row - len(self._links.names)])
        k, row = divmod(row, own)
        for constraint in self._task.constraints:
            if row < constraint.expression.numel():
                return constraint.name, k
            row -= constraint.expression.numel()
        return "", k

    def _linked(self) -> LinearRows:
        """Speed limits, and what ties slopes, bends, levels and stretches of the knots."""
        builder = Builder(self._count, self._size)
        given, slices, N = self._given, self._task.slices, self._joints
        q = np.arange(N)
        limited = np.flatnonzero(np.isfinite(given.speeds))
        reach = given.speeds[limited] * given.duration / (self._count - 1)
        every = np.arange(self._joints)
        most = longest_step(self._count)
        steps = [(1, every, 1.0), (0, every, -1.0)]
        builder.add("step", range(self._count - 1), steps, -most, most)
        ahead, behind = (1, limited, 1.0), (0, limited, -1.0)
        if self._form.shortest:
            stretch = np.full(len(limited), slices["stretch"].start)
            pairs = range(self._count - 1)
            builder.add("speed", pairs, [ahead, behind, (0, stretch, -reach)], -np.inf, 0.0)
            builder.add("speed", pairs, [ahead, behind, (0, stretch, reach)], 0.0, np.inf)
        else:
            builder.add("speed", range(self._count - 1), [ahead, behind], -reach, reach)
        if self._form.rates:
            step = 1.0 / (self._count - 1)
            inner, last = range(1, self._count - 1), self._count - 1
            slope, bend = slices["slopes"].start + q, slices["bends"].start + q
            builder.add(
                "slopes", inner,
                [(0, slope, 1.0), (1, q, -0.5 / step), (-1, q, 0.5 / step)], 0.0, 0.0,
            )  # fmt: skip
            builder.add(
                "bends", inner,
                [(0, bend, step), (1, q, -1 / step), (0, q, 2 / step), (-1, q, -1 / step)],
                0.0, 0.0,
            )  # fmt: skip
            for k, beside in ((0, 1), (last, -1)):
                builder.add("slopes", [k], [(0, slope, 1.0)], 0.0, 0.0)
                builder.add(
                    "bends", [k],
                    [(0, bend, step), (beside, q, -2 / step), (0, q, 2 / step)], 0.0, 0.0,
                )  # fmt: skip
        if self._form.common is not None:
            builder.chain(self._form.common, slices[self._form.common])
        if given.returns:
            builder.add("return", [0], [(0, q, 1.0), (self._count - 1, q, -1.0)], 0.0, 0.0)
        return builder.rows()

    def _lay_out(self) -> None:
        """Patterns of the whole program's derivatives from those of a knot's."""
        task, n, size, N = self._task, self._count, self._size, self._joints
        own = len(task.bounds[0])
        starts = np.arange(n)[:, None]
        rows = np.concatenate(
            [(task.pattern[0] + own * starts).ravel(), self._links.rows + own * n]
        )
        columns = np.concatenate([(task.pattern[1] + size * starts).ravel(), self._links.columns])
        total = own * n + len(self._links.lower)
        mask = np.zeros((size, size), dtype=bool)
        if self._clearance is not None:
            row, column = np.nonzero(self._clearance.moved)
            rows = np.concatenate([rows, row + total])
            columns = np.concatenate([columns, column + size * self._clearance.knots[row]])
            total += self._spaced
            mask[self._clearance.coupled] = True
        self._jacobian, self._jacobian_order = _compressed(total, size * n, rows, columns)
        self._rows_count = total
        mask[task.coupled] = mask[task.curved] = True
        mask[np.arange(N), np.arange(N)] = True
        self._local = np.nonzero(mask)
        i, j = self._local
        beside = (size * starts[:-1] + np.arange(N)).ravel()
        rows = np.concatenate([(i + size * starts).ravel(), beside])
        columns = np.concatenate([(j + size * starts).ravel(), beside + size])
        self._hessian, self._hessian_order = _compressed(size * n, size * n, rows, columns)

    def _solver(self, more: dict[str, object]) -> Ipopt:
        n, size = self._count, self._size
        x, lam = ("x", size * n), ("lam_g", self._rows_count)
        p = ("p", 0)
        one, dense = ca.Sparsity.dense(1), ca.Sparsity.dense
        f, g = ("f", one), ("g", dense(self._rows_count))
        # CasADi keeps no reference of its own to Python's callbacks.
        self._oracle = Evaluated("nlp", [x, p], [f, g], self._values)
        self._gradient = Evaluated(
            "nlp_grad_f", [x, p], [f, ("grad_f_x", dense(size * n))], self._slopes
        )
        self._jacobians = Evaluated(
            "nlp_jac_g", [x, p], [g, ("jac_g_x", self._jacobian)], self._jacobian_of
        )
        self._hessians = Evaluated(
            "nlp_hess_l", [x, p, ("lam_f", 1), lam],
            [("triu_hess_gamma_x_x", self._hessian)], self._hessian_of,
        )  # fmt: skip
        options = _OPTIONS | more | {
            "grad_f": self._gradient, "jac_g": self._jacobians, "hess_lag": self._hessians,
        }  # fmt: skip
        self._nlp = Ipopt("motion", self._oracle, (size * n, 0, self._rows_count), options)
        return self._nlp

    def _values(self, x: Array, p: Array) -> list[Array | float]:
        if self._known is None or not np.array_equal(self._known[0], x):
            self._known = x, self._computed(x)
        return self._known[1]

    def _computed(self, x: Array) -> list[Array | float]:
        y = x.reshape(self._count, self._size)
        values = self._task.value(y, self._given.parameters)
        q = y[:, : self._joints]
        cost = self._calm * float((np.diff(q, axis=0) ** 2).sum())
        if self._form.common is None:
            cost -= float(values[:, 0].mean())
        else:
            cost += self._sign * float(y[0, self._task.slices[self._form.common].start])
        parts = [values[:, 1:].ravel(), self._tied(x)]
        if self._clearance is not None:
            parts.append(self._clearance.values(q))
        return [cost, np.concatenate(parts)]

    def _tied(self, x: Array) -> Array:
        links = self._links
        terms = links.entries * x[links.columns]
        return np.asarray(
            np.bincount(links.rows, weights=terms, minlength=len(links.lower)), dtype=float
        )

    def _slopes(self, x: Array, p: Array) -> list[Array | float]:
        y = x.reshape(self._count, self._size)
        slopes = self._task.slopes(y, self._given.parameters)[:, : self._size]
        gradient = np.zeros_like(y)
        if self._form.common is None:
            gradient = -slopes / self._count
        else:
            gradient[0, self._task.slices[self._form.common]] = self._sign
        moved = 2 * self._calm * np.diff(y[:, : self._joints], axis=0)
        gradient[1:, : self._joints] += moved
        gradient[:-1, : self._joints] -= moved
        return [self._values(x, p)[0], gradient.ravel()]

    def _jacobian_of(self, x: Array, p: Array) -> list[Array | float]:
        y = x.reshape(self._count, self._size)
        entries = self._task.slopes(y, self._given.parameters)[:, self._size :]
        parts = [entries.ravel(), self._links.entries]
        if self._clearance is not None:
            slopes = self._clearance.slopes(y[:, : self._joints])
            parts.append(slopes[self._clearance.moved])
        every = np.concatenate(parts)
        return [self._values(x, p)[1], every[self._jacobian_order]]

    def _hessian_of(self, x: Array, p: Array, sigma: Array, lam: Array) -> list[Array]:
        task, n, size, N = self._task, self._count, self._size, self._joints
        y = x.reshape(n, size)
        own = len(task.bounds[0])
        given = np.empty((n, size + 1 + own))
        given[:, :size] = y
        given[:, size] = -sigma[0] / n if self._form.common is None else 0.0
        given[:, size + 1 :] = lam[: own * n].reshape(n, own)
        beside = np.repeat(given, N + 1, axis=0).reshape(n, N + 1, -1)
        beside[:, np.arange(N), np.arange(N)] += _STEP
        P = self._given.parameters
        slopes = task.lagrangian(
            beside.reshape(n * (N + 1), -1), np.repeat(P, N + 1, axis=0)
        ).reshape(n, N + 1, size)
        columns = (slopes[:, :N] - slopes[:, N:]) / _STEP
        H = np.zeros((n, size, size))
        H[:, :N, :] = columns
        H[:, :N, :N] = (columns[:, :, :N] + columns[:, :, :N].swapaxes(1, 2)) / 2
        if len(task.curved[0]):
            H[:, task.curved[0], task.curved[1]] = task.rest(given, P)
        if self._clearance is not None:
            H[:, :N, :N] += self._clearance.bends(y[:, :N], lam[len(lam) - self._spaced :])
        bend = 2 * self._calm * sigma[0]
        q = np.arange(N)
        H[1:, q, q] += bend
        H[:-1, q, q] += bend
        i, j = self._local
        every = np.concatenate([H[:, i, j].ravel(), np.full(N * (n - 1), -bend)])
        return [every[self._hessian_order]]


def _compressed(
    height: int, width: int, rows: Indices, columns: Indices
) -> tuple[ca.Sparsity, Indices]:
    """A pattern from entries that are all different, and their order in it."""
    order = np.lexsort((rows, columns))
    pattern = ca.Sparsity.triplet(height, width, rows.tolist(), columns.tolist())
    assert pattern.nnz() == len(rows)
    return pattern, order
