"""The shortest motion along a path by one plain program: all knots, contact wrenches, a free time.

Variables are the joints and contact wrenches at the knots and the duration; velocities and
accelerations are central differences, at rest at both ends. Constraints are closure, the limits of
position, speed, acceleration and torque, and the equations of motion of arms and object. IPOPT,
exact Hessian on CasADi's virtual machine. It starts from closed postures followed knot by knot.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pinocchio as pin
from building import Tables
from cases import Case
from programs import _OPTIONS as IPOPT
from sampling import CLOSED, closed_starts, project
from truth import Array, Truth

import copose
from copose.cell.cell import Cell
from copose.poses import Pose
from object_path import ObjectPath

_FIRST = 3.0  # s, the duration that it starts from
_LEAST = 0.05
_JUMP = 0.5  # rad between two knots, beyond which a start has changed its branch
_FORCE = 10.0  # N and N·m, the unit of wrenches


class PlainShortest:
    """The program of one path, written down plainly."""

    def __init__(self, tables: Tables) -> None:
        """Write the graph down."""
        problem = copose.parse(tables)
        cell = Cell.of(problem)
        self._tables, self._cell = tables, cell
        self._path = ObjectPath(tables, 1.0)
        self._count = int(tables["path"]["knots"])
        self._phases = np.linspace(0.0, 1.0, self._count)
        self._truth = Truth(Case(tables["name"], "", tables))
        self._solver = self._written()

    def _written(self) -> ca.Function:
        cell, n = self._cell, self._count
        system = cell.system
        N, m = system.q.numel(), system.space.m
        wrenches = m * len(system.arms)
        one = self._knot()
        q = ca.MX.sym("q", N, n)
        h = ca.MX.sym("h", wrenches, n)
        T = ca.MX.sym("T")
        step = T / (n - 1)
        # At rest before the first knot and after the last: what is beyond mirrors what is inside.
        wide = ca.horzcat(q[:, 1], q, q[:, -2])
        rates = (wide[:, 2:] - wide[:, :-2]) / (2 * step)
        bends = (wide[:, 2:] - 2 * wide[:, 1:-1] + wide[:, :-2]) / step**2
        moving = [self._path.at(u) for u in self._phases]
        places = np.array([self._numbers(now) for now in moving]).T
        twists = np.array([np.concatenate([now.velocity, now.omega]) for now in moving]).T / T
        pulls = np.array([np.concatenate([now.acceleration, now.alpha]) for now in moving]).T / T**2
        rows = one.map(n)(q, rates, bends, _FORCE * h, places, twists, pulls)
        differences = (q[:, 1:] - q[:, :-1]) / step
        g = ca.vertcat(*(ca.vec(each) for each in (*rows, differences, bends)))
        joints = [joint for arm in cell.arms for joint in arm.joints]
        fast = np.array([joint.velocity for joint in joints])
        brisk = np.array([joint.acceleration for joint in joints])
        strong = np.concatenate(cell.efforts)
        highs = [np.zeros(wrenches), np.zeros(len(system.space.balance)), strong]
        high = np.concatenate([np.tile(each, n) for each in highs])
        self._high = np.concatenate([high, np.tile(fast, n - 1), np.tile(brisk, n)])
        x = ca.vertcat(ca.vec(q), ca.vec(h), T)
        self._lower = np.concatenate(
            [np.tile(np.concatenate(cell.lower), n), np.full(wrenches * n, -np.inf), [_LEAST]]
        )
        self._upper = np.concatenate(
            [np.tile(np.concatenate(cell.upper), n), np.full(wrenches * n, np.inf), [np.inf]]
        )
        return ca.nlpsol("shortest", "ipopt", {"x": x, "f": T, "g": g}, IPOPT | {"ipopt.tol": 1e-7})

    def _knot(self) -> ca.Function:
        """Closure, the object's balance and the torques at one knot."""
        cell = self._cell
        system, held = cell.system, cell.system.object
        m, K = system.space.m, len(system.arms)
        rates, bends = ca.SX.sym("rates", system.q.numel()), ca.SX.sym("bends", system.q.numel())
        h, twist, pull = ca.SX.sym("h", m * K), ca.SX.sym("twist", 6), ca.SX.sym("pull", 6)
        torques, first = [], 0
        balance = ca.SX(len(system.space.balance), 1)
        fall = ca.DM(system.gravity)
        for i, arm in enumerate(system.arms):
            part, own = slice(first, first + arm.arm.n), h[m * i : m * (i + 1)]
            turn, down = arm.R_world_root.T, arm.base.rotation.T @ fall
            torques.append(arm.driven(bends[part], down, turn @ own, rates[part])[0])
            balance += held.balance[i] @ own
            first += arm.arm.n
        omega = twist[3:]
        force = held.mass * (pull[:3] - fall)
        moment = held.inertia @ pull[3:] + ca.cross(omega, held.inertia @ omega)
        load = ca.vertcat(force, moment)[list(system.space.balance)]
        closure = ca.vertcat(*(system.closure(i) for i in range(K)))
        return ca.Function(
            "knot",
            [system.q, rates, bends, h, system.parameters, twist, pull],
            [closure, balance - load, ca.vertcat(*torques)],
        )

    def _numbers(self, now: object) -> Array:
        """The system's parameters with the object somewhere."""
        quaternion = pin.Quaternion(now.rotation).coeffs()[[3, 0, 1, 2]]
        pose = Pose.make(now.position, now.rotation, quaternion)
        return np.concatenate([pose.position, pose.quaternion, self._cell.parameters[7:]])

    def ends(self, seed: int) -> Iterator[tuple[float | None, float]]:
        """Minus the duration where one program after another ends, and its processor seconds."""
        starts = iter(())
        while True:
            began = time.process_time()
            first = next(starts, None)
            if first is None:
                self._place(0)
                starts, seed = iter(closed_starts(self._truth, 32, seed)), seed + 1
                continue
            q = self._followed(first)
            value = None if q is None else self._climbed(q)
            yield value, time.process_time() - began

    def _place(self, k: int) -> None:
        now = self._path.at(self._phases[k])
        self._truth.place(pin.SE3(now.rotation, now.position))

    def _followed(self, first: Array) -> Array | None:
        """Postures at all knots, (N, n), each the closing of the one before."""
        edges = np.cumsum([len(low) for low in self._truth.lower])[:-1]
        parts, found = np.split(first, edges), [first]
        for k in range(1, self._count):
            self._place(k)
            for i, part in enumerate(parts):
                end, gap = project(self._truth, i, part[None])
                if gap[0] > CLOSED or np.abs(end[0] - part).max() > _JUMP:
                    return None
                parts[i] = end[0]
            found.append(np.concatenate(parts))
        return np.array(found).T

    def _climbed(self, q: Array) -> float | None:
        size = len(self._lower) - q.size - 1
        start = np.concatenate([q.T.ravel(), np.zeros(size), [_FIRST]])
        low = np.where(self._high > 0, -self._high, 0.0)
        answer = self._solver(x0=start, lbx=self._lower, ubx=self._upper, lbg=low, ubg=self._high)
        good = self._solver.stats()["return_status"] == "Solve_Succeeded"
        return -float(answer["f"]) if good else None
