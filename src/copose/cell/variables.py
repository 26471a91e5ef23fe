"""Postures of several cases and what they share: how the variables of one program are laid out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.poses import Array


@dataclass(frozen=True, eq=False)
class Places:
    """The layout of the variables of a program where more than joints is free.

    x = (joints of every case; free coordinates of the object in every case; those of the arms,
    which all cases share; what else each case has).

    Attributes:
        cell: one of the cases'.
        freedom: what is free.
        cases: their names; one without a name where there are none.
    """

    cell: Cell
    freedom: Freedom
    cases: tuple[str, ...]

    @property
    def suffixes(self) -> list[str]:
        """Endings of a constraint's name by case."""
        return [f" in case {name}" if name else "" for name in self.cases]

    @property
    def size(self) -> int:
        """Free coordinates of all cases together."""
        own = len(self.freedom.owned)
        return own * len(self.cases) + len(self.freedom) - own

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the free coordinates of all cases."""
        return self.joined([self.freedom.lower] * len(self.cases)), self.joined(
            [self.freedom.upper] * len(self.cases)
        )

    def joined(self, each: Sequence[Array]) -> Array:
        """The free coordinates of all cases from those of each, (d,), with the first's arms."""
        own = len(self.freedom.owned)
        return np.concatenate([*(x[:own] for x in each), each[0][own:]])

    def parted(self, free: Array) -> list[Array]:
        """The free coordinates of each case, (d,), from those of all."""
        own, count = len(self.freedom.owned), len(self.cases)
        shared = free[own * count :]
        return [np.concatenate([free[own * k : own * (k + 1)], shared]) for k in range(count)]

    def own(self, free: ca.SX, k: int) -> ca.SX:
        """The coordinates of case k among those of all, (d,)."""
        own = len(self.freedom.owned)
        return ca.vertcat(free[own * k : own * (k + 1)], free[own * len(self.cases) :])

    def taken(self, start: Array, given: Sequence[Array]) -> list[tuple[Array, Array]]:
        """Joints and `System.parameters` of every case, from a start and its `Freedom.numbers`."""
        joints = np.split(start[: len(start) - self.size], len(self.cases))
        free = self.parted(start[len(start) - self.size :])
        numbers = [
            np.array(self._parameters(x, place)).ravel()
            for x, place in zip(free, given, strict=True)
        ]
        return list(zip(joints, numbers, strict=True))

    @cached_property
    def _parameters(self) -> ca.Function:
        x, given = ca.SX.sym("x", len(self.freedom)), ca.SX.sym("given", self.count)
        return ca.Function("parameters", [x, given], [self.moved(x, given)])

    @property
    def count(self) -> int:
        """The number of `Freedom.numbers`."""
        return len(self.freedom.numbers(self.cell))

    def moved(self, x: ca.SX, given: ca.SX) -> ca.SX:
        """The parameters of a cell that is moved, see `Freedom.parameters`."""
        return self.freedom.parameters(self.cell.system, x, given)

    @cached_property
    def closing(self) -> ca.Function:
        """Closure of all cases, (C·K·m,), and its derivative, of joints with what is free and of
        the `Freedom.numbers` of every case.
        """
        system, cases = self.cell.system, range(len(self.cases))
        one = ca.Function(
            "closure",
            [system.q, system.parameters],
            [ca.vertcat(*(system.closure(i) for i in range(len(system.arms))))],
        )
        joints = [ca.SX.sym(f"q_{k}", system.q.numel()) for k in cases]
        given = [ca.SX.sym(f"places_{k}", self.count) for k in cases]
        free = ca.SX.sym("free", self.size)
        rows = [one(joints[k], self.moved(self.own(free, k), given[k])) for k in cases]
        x, residual = ca.vertcat(*joints, free), ca.vertcat(*rows)
        return ca.Function("closing", [x, ca.vertcat(*given)], [residual, ca.jacobian(residual, x)])

    @cached_property
    def _fixed(self) -> ca.Function:
        """Closure of the arms that are held, and its derivative, of x, (d,), and numbers."""
        system = self.cell.system
        x, given = ca.SX.sym("x", len(self.freedom)), ca.SX.sym("given", self.count)
        held = [i for i, arm in enumerate(self.cell.arms) if arm.fixed]
        rows = ca.vertcat(*(system.closure(i) for i in held))
        starts = [np.zeros(arm.n) if arm.start is None else arm.start for arm in self.cell.arms]
        residual = ca.substitute(
            rows,
            ca.vertcat(system.q, system.parameters),
            ca.vertcat(ca.DM(np.concatenate(starts)), self.moved(x, given)),
        )
        return ca.Function("fixed", [x, given], [residual, ca.jacobian(residual, x)])

    def held_by_fixed(self, cells: Sequence[Cell], xs: Sequence[Array]) -> tuple[Array, ...] | None:
        """Free coordinates near those of each case, (d,), at which fixed arms hold the object."""
        from scipy.optimize import least_squares

        given = [self.freedom.numbers(cell) for cell in cells]
        low, high = self.bounds
        own = len(self.freedom.owned)

        def residual(free: Array) -> Array:
            each = zip(self.parted(free), given, strict=True)
            return np.concatenate([np.array(self._fixed(x, n)[0]).ravel() for x, n in each])

        def slope(free: Array) -> Array:
            rows = []
            for k, (x, n) in enumerate(zip(self.parted(free), given, strict=True)):
                slopes = np.array(self._fixed(x, n)[1])
                whole = np.zeros((len(slopes), self.size))
                whole[:, own * k : own * (k + 1)] = slopes[:, :own]
                whole[:, own * len(given) :] = slopes[:, own:]
                rows.append(whole)
            return np.vstack(rows)

        end = least_squares(
            residual,
            np.clip(self.joined(xs), low + 1e-9 * (high - low), high - 1e-9 * (high - low)),
            jac=slope,
            bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200,
        )  # fmt: skip
        # What a fixed arm may miss its grasp by.
        return tuple(self.parted(end.x)) if np.sqrt(2 * end.cost) <= 1e-10 else None

    @cached_property
    def pinned(self) -> Array:
        """Combinations of the fixed arms' closures that depend on what is free, (rank, rows).

        A program must not have more equations than they can tell apart.
        """
        if not any(arm.fixed for arm in self.cell.arms):
            return np.zeros((0, 0))
        cells = self.cell.cases
        nominal = [self.freedom.nominal] * len(cells)
        xs = self.held_by_fixed(cells, nominal) or nominal
        slopes = [
            np.array(self._fixed(x, self.freedom.numbers(cell))[1])
            for x, cell in zip(xs, cells, strict=True)
        ]
        U, values, _ = np.linalg.svd(np.hstack(slopes), full_matrices=False)
        return np.asarray(U[:, values > 1e-8].T)
