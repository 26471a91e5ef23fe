"""The other ways to a posture: local solvers that are started from closed postures.

Every peer is built for a case and solves from stacked joints, wherever the object then is.
"""

from __future__ import annotations

import importlib.util
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
import scipy.optimize
from cases import Case
from numpy_model import NumpyModel
from programs import End, PlainProgram
from truth import Array

from copose.poses import Pose


class Peer(ABC):
    """A local solver of the posture program.

    Attributes:
        name: in tables.
        needs: the module it imports, with the extra that brings it.
    """

    name: ClassVar[str]
    needs: ClassVar[str | None] = None

    @classmethod
    def available(cls) -> bool:
        """Whether what it needs is installed."""
        return cls.needs is None or importlib.util.find_spec(cls.needs) is not None

    @abstractmethod
    def build(self, case: Case) -> None:
        """Make ready for a case, warm solves included."""

    @abstractmethod
    def local_solve(
        self, start: Array, object_pose: Pose | None = None, warm: End | None = None
    ) -> End:
        """One solve from stacked joints (N,); ``warm`` is an earlier end to go on from."""


class _PlainIpopt(Peer):
    hessian: ClassVar[str]

    def build(self, case: Case) -> None:
        """One graph, two sets of options."""
        self._program = PlainProgram(case, self.hessian)
        self._program.prepare_warm()

    def local_solve(
        self, start: Array, object_pose: Pose | None = None, warm: End | None = None
    ) -> End:
        """IPOPT on the graph."""
        return self._program.solve(start, object_pose, warm)


class PlainIpoptExact(_PlainIpopt):
    """CasADi's exact Hessian."""

    name, hessian = "IPOPT, one graph, exact Hessian", "exact"


class PlainIpoptLimitedMemory(_PlainIpopt):
    """L-BFGS."""

    name, hessian = "IPOPT, one graph, L-BFGS", "limited-memory"


class Slsqp(Peer):
    """scipy's SLSQP on numpy and Pinocchio: analytic constraint Jacobian, differenced cost.

    Whoever knows that the arms meet in a sum differences one arm at a time.
    """

    name = "SLSQP + Pinocchio, differenced arm by arm"
    by_arm: ClassVar[bool] = True

    def build(self, case: Case) -> None:
        """Read the robots."""
        self._model = NumpyModel(case)
        self._nominal = case.problem.object.pose

    def local_solve(
        self, start: Array, object_pose: Pose | None = None, warm: End | None = None
    ) -> End:
        """One run of SLSQP; a warm start is its joints."""
        model = self._model
        model.place(self._nominal if object_pose is None else object_pose)
        memory: dict[bytes, tuple[Array, Array]] = {}

        def closure(q: Array, which: int) -> Array:
            key = q.tobytes()
            if key not in memory:
                memory.clear()
                memory[key] = model.closure(q), model.closure_jacobian(q)
            return memory[key][which]

        try:
            answer = scipy.optimize.minimize(
                model.cost,
                start if warm is None else warm.q,
                jac=(lambda q: model.cost_and_gradient(q)[1]) if self.by_arm else "2-point",
                bounds=scipy.optimize.Bounds(model.lower, model.upper),
                constraints={
                    "type": "eq",
                    "fun": lambda q: closure(q, 0),
                    "jac": lambda q: closure(q, 1),
                },
                method="SLSQP",
                options={"ftol": 1e-12, "maxiter": 200},
            )
        except np.linalg.LinAlgError as error:
            return End(np.array(start), False, str(error))
        q = np.clip(answer.x, model.lower, model.upper)
        return End(q, bool(answer.success), str(answer.message))


class PlainSlsqp(Slsqp):
    """The same with the cost differenced by scipy, over all joints."""

    name, by_arm = "SLSQP + Pinocchio", False


class _Drake(Peer):
    needs = "pydrake"

    def build(self, case: Case) -> None:
        """Read the robots, write the program down."""
        from pydrake.solvers import MathematicalProgram

        self._model = model = NumpyModel(case)
        self._nominal = case.problem.object.pose
        program = MathematicalProgram()
        q = program.NewContinuousVariables(len(model.lower), "q")
        program.AddBoundingBoxConstraint(model.lower, model.upper, q)
        program.AddCost(_with_slope(lambda x: model.cost(x), model.cost_and_gradient), vars=q)
        count = len(model.truth.names) * len(model.truth.reference.rows)
        zero = np.zeros(count)
        program.AddConstraint(
            _with_slope(model.closure, lambda x: (model.closure(x), model.closure_jacobian(x))),
            lb=zero,
            ub=zero,
            vars=q,
        )
        self._program = program
        self._solver, self._options = self._make()

    @abstractmethod
    def _make(self) -> tuple[Any, Any]:
        """A solver and its options."""

    def local_solve(
        self, start: Array, object_pose: Pose | None = None, warm: End | None = None
    ) -> End:
        """One run; a warm start is its joints."""
        model = self._model
        model.place(self._nominal if object_pose is None else object_pose)
        begin = start if warm is None else warm.q
        try:
            answer = self._solver.Solve(self._program, begin, self._options)
        except np.linalg.LinAlgError as error:
            return End(np.array(begin), False, str(error))
        q = np.clip(answer.get_x_val(), model.lower, model.upper)
        return End(q, bool(answer.is_success()), str(answer.get_solution_result()))


def _with_slope(plain: Any, with_slope: Any) -> Any:
    """A function that Drake may call with numbers or with its own derivative-carrying ones."""
    from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue

    def function(x: Array) -> Any:
        if x.dtype != object:
            return plain(x)
        values, slopes = ExtractValue(x).ravel(), ExtractGradient(x)
        value, slope = with_slope(values)
        if np.ndim(value) == 0:
            return AutoDiffXd(value, slope @ slopes)
        carried = slope @ slopes
        return np.array([AutoDiffXd(v, d) for v, d in zip(value, carried, strict=True)])

    return function


class DrakeIpopt(_Drake):
    """Drake's IPOPT, L-BFGS as Drake hands it no Hessian."""

    name = "Drake IPOPT + Pinocchio"

    def _make(self) -> tuple[Any, Any]:
        from pydrake.solvers import IpoptSolver, SolverOptions

        options = SolverOptions()
        options.SetOption(IpoptSolver.id(), "tol", 1e-7)
        options.SetOption(IpoptSolver.id(), "constr_viol_tol", 1e-9)
        options.SetOption(IpoptSolver.id(), "bound_relax_factor", 0.0)
        options.SetOption(IpoptSolver.id(), "max_iter", 300)
        return IpoptSolver(), options


class DrakeSnopt(_Drake):
    """Drake's SNOPT."""

    name = "Drake SNOPT + Pinocchio"

    def _make(self) -> tuple[Any, Any]:
        from pydrake.solvers import SnoptSolver, SolverOptions

        options = SolverOptions()
        options.SetOption(SnoptSolver.id(), "Major feasibility tolerance", 1e-9)
        options.SetOption(SnoptSolver.id(), "Major optimality tolerance", 1e-6)
        options.SetOption(SnoptSolver.id(), "Major iterations limit", 300)
        return SnoptSolver(), options


PEERS: dict[str, type[Peer]] = {
    "ipopt-exact": PlainIpoptExact,
    "ipopt-lbfgs": PlainIpoptLimitedMemory,
    "slsqp": PlainSlsqp,
    "slsqp-by-arm": Slsqp,
    "drake-ipopt": DrakeIpopt,
    "drake-snopt": DrakeSnopt,
}
