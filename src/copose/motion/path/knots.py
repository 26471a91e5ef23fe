"""A journey at chosen instants, as the arms' kernels take it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.collision import configurations, joint_columns
from copose.motion.path.object_motion import ObjectMotion, ObjectState
from copose.poses import Array, Indices
from copose.posture.model import PostureModel
from copose.posture.setting import Setting


@dataclass(frozen=True, eq=False)
class Course:
    """Where the object and the tips are at n instants; rates by the share φ of the duration.

    Attributes:
        phases: φ, (n,).
        stations: the object's.
        settings: what the kernels take there.
        goals: of the tips by arm, see `Placement`, (n, 7).
        velocities: of the contacts by arm, world axes, (n, m).
        accelerations: alike.
    """

    phases: Array
    stations: tuple[ObjectState, ...]
    settings: tuple[Setting, ...]
    goals: tuple[Array, ...]
    velocities: tuple[Array, ...]
    accelerations: tuple[Array, ...]

    @classmethod
    def of(cls, model: PostureModel, journey: ObjectMotion, phases: Array) -> Course:
        """A journey of the object of a cell."""
        cell = model.cell
        space = cell.system.space
        stations = tuple(journey.at(phase) for phase in phases)
        settings: list[Setting] = []
        for k, station in enumerate(stations):
            still = k > 0 and np.array_equal(_numbers(station), _numbers(stations[k - 1]))
            if still:
                settings.append(settings[-1])
                continue
            pose = station.pose
            place: dict[str, object] = {"position": pose.position, "rpy": pose.rpy}
            if space.planar:
                place = {"position": pose.position[:2], "angle": pose.rpy[2]}
            settings.append(model.setting(cell.moved(place)))
        rows, K = list(space.rows), range(len(cell.arms))
        goals = [np.array([setting.placement.goals[i] for setting in settings]) for i in K]
        velocities, accelerations = [], []
        for arm in cell.arms:
            moved = [_contact(station, arm.grasp.position) for station in stations]
            velocities.append(np.array([v[rows] for v, _ in moved]))
            accelerations.append(np.array([a[rows] for _, a in moved]))
        return cls(
            phases, stations, tuple(settings), tuple(goals), tuple(velocities), tuple(accelerations)
        )

    @cached_property
    def _still(self) -> tuple[Array, Indices]:
        """Where everything is with all joints at zero, (n, size), and which numbers they are."""
        arms = self.settings[0].cell.arms
        poses = [setting.cell.problem.object.pose for setting in self.settings]
        x = configurations(arms, [arm.base for arm in arms], [None] * len(arms), poses)
        return x, joint_columns(arms)

    def configurations(self, q: Array) -> Array:
        """Where everything is with joints at every instant, (n, N); (n, size)."""
        x, columns = self._still[0].copy(), self._still[1]
        x[:, columns] = q
        return x

    def __len__(self) -> int:
        return len(self.phases)

    def inertial_loads(self, inertia: Array | None) -> Array:
        """Force m a over moment I α + ω × I ω, by φ twice, in the rows of `Space.balance`, (n, b).

        Args:
            inertia: of the object about its centre of mass, object axes, (3, 3); None for none.
        """
        cell = self.settings[0].cell
        mass, balance = cell.problem.object.mass, list(cell.system.space.balance)
        about = np.zeros((3, 3)) if inertia is None else inertia
        loads = []
        for station in self.stations:
            R = station.pose.rotation
            own = R @ about @ R.T
            w, alpha = station.velocity[3:], station.acceleration[3:]
            moment = own @ alpha + np.cross(w, own @ w)
            loads.append(np.concatenate([mass * station.acceleration[:3], moment])[balance])
        return np.array(loads)


def _numbers(station: ObjectState) -> Array:
    return np.concatenate([station.pose.position, station.pose.quaternion])


def _contact(station: ObjectState, grasp: Array) -> tuple[Array, Array]:
    """Velocity v + ω × r over ω and acceleration a + α × r + ω × (ω × r) over α, (6,) each."""
    r = station.pose.rotation @ grasp
    v, w = np.split(station.velocity, 2)
    a, alpha = np.split(station.acceleration, 2)
    velocity = np.concatenate([v + np.cross(w, r), w])
    bend = a + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
    return velocity, np.concatenate([bend, alpha])


def uniform(count: int) -> Array:
    """Instants from the beginning to the end, (count,)."""
    return np.linspace(0.0, 1.0, count)


def interpolated(phases: Array, q: Array, wanted: Array) -> Array:
    """Joint positions, (n, N), straight between the instants, at others, (count, N)."""
    return np.column_stack([np.interp(wanted, phases, column) for column in q.T])


def slopes(q: Array, step: float) -> Array:
    """Central differences, zero at both ends, (n, N)."""
    found = np.zeros_like(q)
    found[1:-1] = (q[2:] - q[:-2]) / (2 * step)
    return found


def bends(q: Array, step: float) -> Array:
    """Second differences; at the ends, where nothing moves, of knots mirrored there, (n, N)."""
    found = np.empty_like(q)
    found[1:-1] = (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
    found[0], found[-1] = 2 * (q[1] - q[0]) / step**2, 2 * (q[-2] - q[-1]) / step**2
    return found


def spline_slopes(q: Array, step: float) -> Array:
    """Slopes, (n, N), of the cubic spline through the knots that is at rest at both ends.

    v[k−1] + 4 v[k] + v[k+1] = 3 (q[k+1] − q[k−1]) / step.
    """
    found = np.zeros_like(q)
    inner = len(q) - 2
    found[1:-1] = tridiagonal(np.full(inner, 4.0), np.ones(inner), 6 * slopes(q, step)[1:-1])
    return found


def tridiagonal(diagonal: Array, beside: Array, right: Array) -> Array:
    """The solution of a symmetric system, (n,) or (n, N), by elimination from end to end.

    Written out because the library's solvers take longer to load than a motion to plan.

    Args:
        diagonal: (n,).
        beside: the entry of each row right of its diagonal, (n,); the last does not count.
        right: (n,) or (n, N).
    """
    pivots, found = diagonal.copy(), right.copy()
    for k in range(1, len(pivots)):
        factor = beside[k - 1] / pivots[k - 1]
        pivots[k] -= factor * beside[k - 1]
        found[k] -= factor * found[k - 1]
    for k in range(len(pivots) - 1, -1, -1):
        if k + 1 < len(pivots):
            found[k] -= beside[k] * found[k + 1]
        found[k] /= pivots[k]
    return found
