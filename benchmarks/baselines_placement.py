"""Placements without copose's search: IPOPT from many starts, and SciPy's `direct` over offsets.

The joint program has the joints of all cases and everything free as variables, closure and limits
as constraints, one CasADi graph, L-BFGS. Its starts are random within all limits and closed by
`scipy.optimize.least_squares`. `direct` divides the ranges of the offsets and asks a low search of
copose for the best posture at each point.
"""

from __future__ import annotations

import contextlib
import copy
import time
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np
import scipy.optimize
from building import Tables
from programs import _OPTIONS as IPOPT
from truth import Array

import copose
from copose.capability import RESOLUTIONS, log_ball_volume, log_det
from copose.cell.cell import Cell
from copose.cell.freedom import Freedom
from copose.cell.variables import Places
from copose.robots import finite_range

Ends = Iterator[tuple[float | None, float]]
"""Values of what was tried, None where nothing came of it, and the processor seconds it took."""

_CLOSED = 1e-8


class JointProgram:
    """Everything free at once, written down plainly."""

    def __init__(self, tables: Tables) -> None:
        """Write the graph down."""
        problem = copose.parse(tables)
        cell = Cell.of(problem)
        system, cells = cell.system, cell.cases
        names = tuple(case.name for case in problem.cases) or ("",)
        places = Places(cell, Freedom.of(problem), names)
        axes = list(problem.axes)
        G = RESOLUTIONS[problem.ellipsoid.resolution].system_gram(system, cell.scales)[axes, axes]
        closure = ca.vertcat(*(system.closure(i) for i in range(len(system.arms))))
        weights = [case.weight for case in problem.cases] or [1.0]
        free = ca.SX.sym("free", places.size)
        joints, rows, total = [], [], ca.SX(0)
        for k, one in enumerate(cells):
            q = ca.SX.sym(f"q_{k}", system.q.numel())
            numbers = ca.DM(places.freedom.numbers(one))
            moved = places.moved(places.own(free, k), numbers)
            posture = ca.Function("case", [system.q, system.parameters], [_value(one, G), closure])
            value, residual = posture(q, moved)
            total += weights[k] * value
            joints.append(q)
            rows.append(residual)
        x, residual = ca.vertcat(*joints, free), ca.vertcat(*rows)
        limits = zip(cell.lower, cell.upper, strict=True)
        ends = [
            np.concatenate(side)
            for side in zip(*(finite_range(*each) for each in limits), strict=True)
        ]
        self._lower, self._upper = (
            np.concatenate([np.tile(joint, len(cells)), offsets])
            for joint, offsets in zip(ends, places.bounds, strict=True)
        )
        self._closing = ca.Function("closing", [x], [residual, ca.jacobian(residual, x)])
        graph = {"x": x, "f": -total, "g": residual}
        options = IPOPT | {"ipopt.hessian_approximation": "limited-memory"}
        self._solver = ca.nlpsol("joint", "ipopt", graph, options)

    def ends(self, seed: int) -> Ends:
        """One climb after another, each from a random start that is closed first."""
        rng = np.random.default_rng(seed)
        while True:
            began = time.process_time()
            start = self._closed(rng)
            value = None if start is None else self._climbed(start)
            yield value, time.process_time() - began

    def _closed(self, rng: np.random.Generator) -> Array | None:
        low, high = self._lower, self._upper
        end = scipy.optimize.least_squares(
            lambda x: np.array(self._closing(x)[0]).ravel(),
            rng.uniform(low, high),
            jac=lambda x: np.array(self._closing(x)[1]),
            bounds=(low - 1e-12, high + 1e-12),
            max_nfev=60,
        )
        return end.x if np.sqrt(2 * end.cost) < 1e-3 else None

    def _climbed(self, start: Array) -> float | None:
        answer = self._solver(x0=start, lbx=self._lower, ubx=self._upper, lbg=0.0, ubg=0.0)
        open_by = np.abs(np.array(answer["g"])).max()
        good = self._solver.stats()["return_status"] == "Solve_Succeeded" and open_by < _CLOSED
        return -float(answer["f"]) if good else None


def _value(cell: Cell, G: ca.SX) -> ca.SX:
    """The objective of a case: volume or task compatibility."""
    wanted, problem = cell.problem.objective, cell.problem
    if wanted.kind == "volume":
        return log_ball_volume(G.shape[0]) - log_det(G) / 2
    value = ca.SX(0)
    for weighted in wanted.directions:
        u = ca.DM(problem.along(weighted.direction))
        value -= weighted.weight * ca.log(ca.dot(u, G @ u)) / 2
    return value


def joint_program(tables: Tables, seed: int) -> Ends:
    """IPOPT from many starts."""
    return JointProgram(tables).ends(seed)


class Divided:
    """The best posture at offsets by a search of copose, for `direct`."""

    def __init__(self, tables: Tables) -> None:
        """One planner for all offsets and cases."""
        self._ranges = list(_ranges(tables))
        self._tables = copy.deepcopy(tables)
        self._cases: list[Tables] = self._tables.pop("cases", [{}])
        self._tables["object"].pop("freedom", None)
        for arm in self._tables["arms"]:
            arm.pop("freedom", None)
        self._planner = copose.Planner(copose.parse(self._tables), movable=True)
        self._planner.compile()

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Ranges of the offsets."""
        return [(low, high) for *_, (low, high) in self._ranges]

    def value(self, x: Array) -> float | None:
        """Σ weight · objective of the best postures; None where a case has none."""
        total = 0.0
        for case in self._cases:
            problem = copose.parse(self._moved(x, case))
            answer = self._planner.solve(problem=problem, effort="low", seed=0)
            if answer.objective.after is None:
                return None
            total += case.get("weight", 1.0) * answer.objective.after
        return total

    def _moved(self, x: Array, case: Tables) -> Tables:
        tables = copy.deepcopy(self._tables)
        thing = tables["object"]
        thing |= {key: case[key] for key in ("position", "rpy") if key in case}
        if "mass" in case:
            ratio = case["mass"] / thing["mass"]
            thing |= {"mass": case["mass"], "inertia": [ratio * x for x in thing["inertia"]]}
        if "direction" in case:
            tables["objective"]["directions"] = [{"direction": case["direction"]}]
        for (i, what, name, _), offset in zip(self._ranges, x, strict=True):
            pose = thing if i is None else tables["arms"][i].setdefault(what, {})
            key, place = ("rpy", 2) if name == "yaw" else ("position", "xyz".index(name))
            numbers = list(pose.get(key, [0.0, 0.0, 0.0]))
            numbers[place] += float(offset)
            pose[key] = numbers
        return tables


def _ranges(tables: Tables) -> Iterator[tuple[int | None, str, str, tuple[float, float]]]:
    """What is free: whose, of what, which coordinate, and its range."""
    for name, range_ in tables["object"].get("freedom", {}).items():
        yield None, "object", name, tuple(range_)
    for i, arm in enumerate(tables["arms"]):
        for what, names in arm.get("freedom", {}).items():
            for name, range_ in names.items():
                yield i, what, name, tuple(range_)


class _EnoughError(Exception):
    """The time is up."""


def direct(tables: Tables, budget: float) -> list[tuple[float | None, float]]:
    """What `scipy.optimize.direct` evaluates within so many processor seconds."""
    divided = Divided(tables)
    told: list[tuple[float | None, float]] = []
    began = time.process_time()

    def cost(x: Any) -> float:
        if time.process_time() - began > budget:
            raise _EnoughError
        before = time.process_time()
        value = divided.value(x)
        told.append((value, time.process_time() - before))
        return 1e3 if value is None else -value

    with contextlib.suppress(_EnoughError):
        scipy.optimize.direct(cost, divided.bounds, maxfun=10**6, maxiter=10**6, vol_tol=0.0)
    return told
