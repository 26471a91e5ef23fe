"""The object's path at chosen instants, as the arms' kernels take it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.cell.cell import Cell
from copose.collision import configurations, joint_columns
from copose.motion.path.object_motion import ObjectMotion, ObjectState
from copose.poses import Array, Indices, conjugate, quaternion_product, rotation_rows
from copose.posture.model import PostureModel
from copose.posture.setting import Setting


@dataclass(frozen=True, eq=False)
class Course:
    """Poses of object and tips at n instants; rates by the share φ of the duration."""

    phases: Array  # φ, (n,)
    stations: tuple[ObjectState, ...]  # of the object
    settings: tuple[Setting, ...]  # what the kernels take there
    goals: tuple[Array, ...]  # of the tips by arm, see `KernelInputs`, (n, 7)
    velocities: tuple[Array, ...]  # of the contacts by arm, world axes, (n, m)
    accelerations: tuple[Array, ...]  # alike

    @classmethod
    def of(cls, model: PostureModel, journey: ObjectMotion, phases: Array) -> Course:
        """The object's path at instants φ, (n,)."""
        cell = model.cell
        space = cell.system.space
        stations = journey.states(phases)
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
            velocity, acceleration = _contact(stations, arm.grasp.position)
            velocities.append(velocity[:, rows])
            accelerations.append(acceleration[:, rows])
        return cls(
            phases, stations, tuple(settings), tuple(goals), tuple(velocities), tuple(accelerations)
        )

    @cached_property
    def _at_zero(self) -> tuple[Array, Indices]:
        """Configurations with all joints at zero, (n, size), and the columns of the joints."""
        arms = self.settings[0].cell.arms
        poses = [setting.cell.problem.object.pose for setting in self.settings]
        x = configurations(arms, [arm.base for arm in arms], [None] * len(arms), poses)
        return x, joint_columns(arms)

    def configurations(self, q: Array) -> Array:
        """Configurations, (n, size), with joints at every instant, (n, N)."""
        zero, columns = self._at_zero
        x = zero.copy()
        x[:, columns] = q
        return x

    def __len__(self) -> int:
        return len(self.phases)

    def inertial_loads(self, inertia: Array | None) -> Array:
        """Inertial force m a over moment I α + ω × I ω, by φ twice, in the rows of `Space.balance`,
        (n, b).

        Args:
            inertia: of the object about its centre of mass, object axes, (3, 3); None for none.
        """
        cell = self.settings[0].cell
        mass, balance = cell.problem.object.mass, list(cell.system.space.balance)
        about = np.zeros((3, 3)) if inertia is None else inertia
        R = np.array([station.pose.rotation for station in self.stations])
        own = R @ about @ R.swapaxes(1, 2)
        rates = np.array([(station.velocity, station.acceleration) for station in self.stations])
        w = rates[:, 0, 3:]
        turned, gyrated = (own @ part[:, :, None] for part in (rates[:, 1, 3:], w))
        moment = turned[:, :, 0] + np.cross(w, gyrated[:, :, 0])
        return np.hstack([mass * rates[:, 1, :3], moment])[:, balance]


def _numbers(station: ObjectState) -> Array:
    return np.concatenate([station.pose.position, station.pose.quaternion])


def _contact(stations: Sequence[ObjectState], grasp: Array) -> tuple[Array, Array]:
    """Velocities v + ω × r over ω and accelerations a + α × r + ω × (ω × r) over α, (n, 6) each."""
    r = np.array([station.pose.rotation for station in stations]) @ grasp
    v, w = np.split(np.array([station.velocity for station in stations]), 2, axis=1)
    a, alpha = np.split(np.array([station.acceleration for station in stations]), 2, axis=1)
    turning = np.cross(w, r)
    bend = a + np.cross(alpha, r) + np.cross(w, turning)
    return np.hstack([v + turning, w]), np.hstack([bend, alpha])


def uniform(count: int) -> Array:
    """Instants from the beginning to the end, (count,)."""
    return np.linspace(0.0, 1.0, count)


def tip_goals(cell: Cell, journey: ObjectMotion, i: int, phases: Array) -> Array:
    """Poses that the object asks of the tip of arm i, see `KernelInputs`, (count, 7)."""
    base, grasp = cell.arms[i].base, cell.arms[i].grasp
    positions, quaternions = journey.places(phases)
    rotations = np.array(rotation_rows(quaternions.T)).transpose(2, 0, 1)
    tips = positions + rotations @ grasp.position - base.position
    back = conjugate(base.quaternion)
    turned = quaternion_product(back, quaternion_product(quaternions.T, grasp.quaternion))
    return np.hstack([tips @ base.rotation, np.stack(turned, axis=1)])
