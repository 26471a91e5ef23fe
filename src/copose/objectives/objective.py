"""The interface of an objective: what is maximised over postures.

Search, programs, measurement and report ask an objective, and never which one it is. An objective
is one class; `registry.OBJECTIVES` names its builder by the kind in a problem file.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeAlias

import casadi as ca
import numpy as np

from copose.capability import Ellipsoid, Form, Sums
from copose.capability.torque_limits import Demand
from copose.cell.context import PostureContext
from copose.cell.dynamics import CellDynamics, Holding
from copose.constraints.constraint import Constraint
from copose.mechanics import System
from copose.poses import Array, Indices, Mask
from copose.self_motion.manifold import ClosureManifold

Cuts: TypeAlias = tuple[Demand, ...]
"""Demands that one program has, of those that decide an objective."""


@dataclass(frozen=True, eq=False)
class Term:
    """The term of an objective in a program.

    Attributes:
        value: what is maximised where one posture counts; it grows with the objective.
        natural: the same on the objective's own scale, of which a mean over postures makes sense.
        variables: beside the joints, stacked.
        constraints: on them and on the joints.
        sharp: where ``value`` stands in for an objective that is not smooth, that objective itself;
            its variables join.
        gram: G, (a, a), which must be finite where a program starts.
        exact_hessian: whether second derivatives are simple enough to be written out.
    """

    value: ca.SX
    natural: ca.SX
    variables: ca.SX
    constraints: tuple[Constraint, ...] = ()
    sharp: Term | None = None
    gram: ca.SX | None = None
    exact_hessian: bool = False


@dataclass(frozen=True, eq=False)
class Ranked:
    """Combinations of the arms' postures that an objective itself has compared.

    Attributes:
        chosen: combinations, best first, as indices, (count, K).
        scores: their values, or a little less than bounds of them, (count,).
        combinations: how many were compared.
        bound: no combination is worth more; None where that is not known.
    """

    chosen: Indices
    scores: Array
    combinations: int
    bound: float | None


class LimitReport(Protocol):
    """A statement of what torque limits allow at one posture."""

    def acceleration(self, direction: Array, name: str) -> float | None:
        """State the largest acceleration along a unit direction, (m,); None where there is none."""
        ...

    def payload(self, acceleration: Array) -> float | None:
        """State the largest mass, kg, accelerated so, (m,), or held at rest."""
        ...

    def radius(self, axes: Sequence[int]) -> float | None:
        """State the largest ball of accelerations around rest on some axes."""
        ...


class Objective(ABC):
    """A quantity that is maximised over postures.

    Attributes:
        kind: as written in a problem file.
        unit: of its value.
        sums: what it takes from all arms together.
        scales: T by arm, in which these sums measure torques, (n,).
    """

    form: Form | None = None
    """The ellipsoid that it measures; None where none is."""
    ceiling: ClassVar[float] = np.inf
    """No posture is worth more."""
    summable: ClassVar[bool] = False
    """True for a function of the arms' sums, which Newton steps along self-motions climb; where
    false linear programs decide."""
    non_smooth: ClassVar[bool] = False
    """True where it has kinks at its maxima, so that `score` is a stand-in without any."""
    piecewise: ClassVar[bool] = False
    """True where other demands may count along a climb, which then can end worse than it began."""
    costly: ClassVar[bool] = False
    """True where a climb takes many programs."""
    torque_limited: ClassVar[bool] = False
    """True where torque limits decide."""

    def __init__(self, kind: str, unit: str, sums: Sums, scales: Sequence[Array]) -> None:
        """An objective over some sums."""
        self.kind, self.unit, self.sums, self.scales = kind, unit, sums, tuple(scales)

    @property
    def smooth(self) -> bool:
        """True where `score` is the objective itself."""
        return self.summable and not self.non_smooth

    # Values of many postures.

    @abstractmethod
    def values(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Values of postures, by arm (count, n_i); NaN or −inf where there is none, (count,)."""

    def estimates(self, context: PostureContext, q: Sequence[Array]) -> Array:
        """Values, or a quicker bound of them from above."""
        return self.values(context, q)

    def values_and_grams(
        self, context: PostureContext, q: Sequence[Array]
    ) -> tuple[Array, Array | None]:
        """Values with G of the ellipsoid that is measured, (count, a, a)."""
        return self.values(context, q), None

    def values_of_sums(self, context: PostureContext, sums: Array) -> Array:
        """Values of the arms' sums, (count, s), of an objective that is `summable`."""
        raise NotImplementedError(self.kind)

    # A search of its own.

    def ranked(
        self,
        context: PostureContext,
        q: Sequence[Array],
        allowed: Callable[[Indices], Mask] | None,
    ) -> Ranked | None:
        """The best combinations of postures by arm, (count_i, n_i), of those that are allowed; None
        where `score` and `estimates` have to compare them.
        """
        return None

    def ascended(
        self,
        context: PostureContext,
        arms: Sequence[ClosureManifold],
        q: Sequence[Array],
        *,
        race: bool,
    ) -> list[Array] | None:
        """Local maxima that closed postures, by arm (count, n_i), lead to along the manifolds of
        the arms; NaN of those that fall behind in a race. None where programs have to climb.
        """
        return None

    # A bound over whole cells of postures.

    def bound_sides(self, *, sliced: bool) -> tuple[tuple[int, bool], ...]:
        """The matrices of the arms' terms by which `upper_bounds` bounds it: their numbers, and
        whether from above; none where no bound is known. ``sliced``: some axes alone count.
        """
        return ()

    def upper_bounds(self, corners: Array, M_o: Array) -> Array:
        """Bounds of the values on cells of postures, NaN where there is none, (count,).

        A cell is a segment of each arm's self-motions. What is convex in the sums, and falls where
        they grow, is largest at a corner.

        Args:
            corners: sums over the arms of matrices that, interpolated, are below theirs in
                Loewner's order, or above, (corners, sides, a, a, count).
            M_o: the object's inertia, (a, a).
        """
        raise NotImplementedError(self.kind)

    # Expressions.

    @abstractmethod
    def parameters(self, holding: Holding | None) -> Array:
        """Parameters of `score`, such as directions; they vary without rebuilding."""

    @abstractmethod
    def score(self, sums: ca.SX, M_o: ca.SX, numbers: ca.SX, axes: Sequence[int]) -> ca.SX:
        """The objective, or what stands in for it when postures are compared."""

    def gram(self, sums: ca.SX, M_o: ca.SX, axes: Sequence[int]) -> ca.SX | None:
        """G of the stacked sums, its slice by the axes, (a, a); None where none is measured."""
        return None

    @abstractmethod
    def term(
        self,
        system: System,
        axes: Sequence[int],
        numbers: ca.SX,
        capacity: CellDynamics | None,
        inertia: ca.SX | None = None,
    ) -> Term:
        """The term in a program.

        Args:
            system: the expressions.
            axes: coordinates of the task that count.
            numbers: its parameters in a program, see `program_numbers`.
            capacity: equations of motion, where torque limits matter.
            inertia: M_o for which these parameters are told, (m, m); None where it is the system's.
        """

    # What one program needs.

    def program_size(self, holding: Holding | None) -> int:
        """The number of `program_numbers`."""
        return len(self.parameters(holding))

    def cuts(self, context: PostureContext, q: Sequence[Array]) -> list[Cuts]:
        """The demands with which programs that start at postures, by arm (count, n_i), begin."""
        return [()] * len(q[0])

    def more_cuts(self, context: PostureContext, q: Sequence[Array], cuts: Cuts) -> Cuts | None:
        """Demands for the next program, where one with these ended at a posture, by arm (1, n_i);
        None where nothing that counts there was left out.
        """
        return None

    def program_numbers(self, context: PostureContext, cuts: Cuts) -> Array:
        """Its parameters in a program with such demands."""
        return context.numbers

    def starts(self, context: PostureContext, q: Sequence[Array], cuts: Sequence[Cuts]) -> Array:
        """Starts of the term's variables at postures, by arm (count, n_i); (count, v)."""
        return np.zeros((len(q[0]), 0))

    def sharp_start(self, gram: Array, slack: float) -> Array:
        """Starts of the variables that the sharp term adds at G, (a, a), so wide of bounds."""
        return np.zeros(0)

    def motion_start(
        self, context: PostureContext, q: Sequence[Array], cuts: Cuts, slack: float
    ) -> Array:
        """Starts of all variables of the sharp term at a posture, by arm (1, n_i), (v,); not
        finite where it has none.
        """
        return np.asarray(self.starts(context, q, [cuts])[0])

    def at_ceiling(self, gram: Array) -> bool:
        """True where no posture is worth more than one with such a G, (a, a)."""
        return False

    # What a result states.

    def of(self, ellipsoid: Ellipsoid) -> float:
        """The value of a measured ellipsoid, of an objective that has a `form`."""
        raise NotImplementedError(self.kind)

    def report(self, limits: LimitReport) -> float | None:
        """The value, if torque limits decide it, with what they allow stated."""
        return None
