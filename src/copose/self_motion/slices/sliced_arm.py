"""Complete inverse kinematics of an arm: all postures, or all at which one joint has some angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices, Mask, Pose
from copose.problem import Space
from copose.robots import Arm, finite_range
from copose.self_motion.kernels import ArmKernels
from copose.self_motion.projection import project
from copose.self_motion.slices.elimination import loop_angles, turns
from copose.self_motion.slices.planar_loops import planar_angles

# Of no note, in which a pose is moved: position, m, and quaternion.
_DIRECTION = np.array([0.2, 0.5, -0.4, 0.0, 0.15, -0.35, 0.25])


@dataclass(frozen=True)
class SliceOptions:
    """Slices of self-motions."""

    slices: int = 48  # a joint
    joints: int = 3  # that are locked one after the other, a third of the arm each
    tested: int = 30  # random postures that a cut of the loop has to give back
    # Distances, m and rad, of the pose at which is eliminated, in turns, from the goal: where that
    # is symmetric a pencil may be singular, and where postures nearly meet they part elsewhere:
    # the nearer the fewer are lost. Newton steps close on the goal itself.
    moved: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6)
    steps: int = 24  # of these, at most
    closed: float = 1e-10  # residual of a posture, m and rad
    same: float = 1e-6  # difference of joints that are the same, rad


@dataclass(frozen=True, eq=False)
class ArmSlices:
    """Postures that hold the object, at all slices of an arm's self-motions."""

    postures: Array  # without regard to limits, (count, n)
    joints: tuple[str, ...]  # that were locked; none where no degree of freedom is to spare
    slices: int  # how many
    odd: int  # in how many the count stayed odd: a posture is missing, or two are one


class SlicedArm:
    """An arm with at most one degree of freedom to spare, and slices that meet its self-motions.

    Attributes:
        arm: its numbers.
        kernels: of it.
        fault: why there is no complete inverse kinematics of it; None where there is.
    """

    def __init__(
        self, arm: Arm, kernels: ArmKernels, space: Space, options: SliceOptions = SliceOptions()
    ) -> None:
        """Choose the joints to be locked, and cuts of the loops, by a test at random postures."""
        self.arm, self.kernels, self._space, self._options = arm, kernels, space, options
        self._cuts: dict[int | None, int] = {}
        self.fault = None
        if any(joint.kind != "revolute" for joint in arm.joints):
            self.fault = "has a joint that slides"
        elif arm.n - space.m not in (0, 1):
            self.fault = f"has {arm.n - space.m} degrees of freedom to spare"
        elif space.m == 3 and not space.planar:
            self.fault = "turns freely about its contact"
        elif not self._tested():
            self.fault = "has a spherical shoulder and wrist, too special for elimination"

    def _tested(self) -> bool:
        """Choose joints and cuts that give all postures back; False where there are too few."""
        options, n = self._options, self.arm.n
        low, high = finite_range(self.arm.lower, self.arm.upper)
        q = np.random.default_rng(0).uniform(low, high, (options.tested, n))
        goals = self.kernels.gap(q, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
        if n == self._space.m:
            return self._chosen(None, q, goals)
        assert self.kernels.tangent is not None
        moves = np.abs(self.kernels.tangent(q, goals)[:, :n]).mean(axis=0)
        ranked = np.argsort(-moves, kind="stable").tolist()
        thirds = [[j for j in ranked if j in third]
                  for third in np.array_split(np.arange(n), options.joints)]  # fmt: skip
        # Where no joint of a third can be sliced another takes its place.
        for part in [*thirds, *[ranked] * options.joints]:
            if len(self._cuts) < options.joints:
                any(j not in self._cuts and self._chosen(j, q, goals) for j in part)
        return len(self._cuts) > 1

    def _chosen(self, joint: int | None, q: Array, goals: Array) -> bool:
        """Choose the cut by which a joint is sliced well; False where there is none."""
        values = None if joint is None else q[:, joint]
        for cut in range(5, -1, -1):
            rows, closed = self._solved(goals, joint, values, cut, 0.0)
            near = np.abs(np.exp(1j * closed) - np.exp(1j * q[rows])).max(axis=1)
            known = np.isin(np.arange(len(q)), rows[near < self._options.same])
            if known.all() and not len(_odd(rows, len(q))):
                self._cuts[joint] = cut
                return True
        return False

    def at(self, goal: Array) -> ArmSlices:
        """All postures of all slices at a goal, (7,), see `KernelInputs`."""
        postures, odd, slices = [], 0, self._options.slices
        for joint, cut in self._cuts.items():
            # The fraction keeps slices off angles of note, at which self-motions turn back.
            values = 2 * np.pi * (np.arange(slices) + 0.381966) / slices - np.pi
            values = values if joint is not None else values[:1]
            count = len(values)
            goals, again = np.tile(goal, (count, 1)), np.arange(count)
            rows, q = self._solved(goals, joint, values, cut, self._options.moved[0])
            others = [(moved, other) for moved in self._options.moved for other in range(6)]
            for moved, other in others:
                # Postures are points of their own, which every cut is asked for.
                again = again if joint is None else _odd(rows, count)
                if len(again):
                    more, extra = self._solved(goals[again], joint, values[again], other, moved)
                    rows, q = np.concatenate([rows, again[more]]), np.vstack([q, extra])
                    rows, q = _distinct(rows, q, self._options.same)
            odd += len(_odd(rows, count))
            postures.append(q)
        names = tuple(self.arm.joints[j].name for j in self._cuts if j is not None)
        return ArmSlices(np.vstack(postures), names, slices * len(names) or 1, odd)

    def _solved(
        self, goals: Array, joint: int | None, values: Array | None, cut: int, moved: float
    ) -> tuple[Indices, Array]:
        """Distinct postures of slices: the numbers of the slices, (count,), and postures."""
        if self._space.planar:
            angles, ok = self._planar(goals, joint, values)
        else:
            beside = goals + moved * _DIRECTION
            near = np.array([_matrix(Pose.from_quaternion(g[:3], g[3:])) for g in beside])
            angles, ok = loop_angles(self._loops(near, joint, values), cut)
        rows, n = np.nonzero(ok)[0], self.arm.n
        free, q = np.arange(n) != joint, np.zeros((len(rows), n))
        if joint is not None and values is not None:
            q[:, joint] = values[rows]
        q[:, free] = angles[ok]
        lower, upper = np.where(free, -np.inf, q), np.where(free, np.inf, q)
        ends, gaps = project(self.kernels, q, goals[rows], lower, upper, steps=self._options.steps)
        closed = (gaps < self._options.closed) & np.isfinite(ends).all(axis=1)
        return _distinct(rows[closed], ends[closed], self._options.same)

    def _loops(self, goals: Array, joint: int | None, values: Array | None) -> Array:
        """The motions before the six joints that are free, closed by goals, (count, 6, 4, 4)."""
        count, joints = len(goals), self.arm.joints
        D, before = [], np.eye(4)
        for each in joints:
            axis = Pose.from_rotation(_turned_to(each.axis))
            D.append(np.tile(before @ _matrix(each.placement @ axis), (count, 1, 1)))
            before = _matrix(axis.inverse())
        D[0] = before @ _matrix(self.arm.tip) @ np.linalg.inv(goals) @ D[0]
        if joint is not None and values is not None:
            after = (joint + 1) % len(D)
            D[after] = D[joint] @ turns(values) @ D[after]
            del D[joint]
        return np.stack(D, axis=1)

    def _planar(self, goals: Array, joint: int | None, values: Array | None) -> tuple[Array, Mask]:
        """Angles in the plane, see `planar_angles`."""
        zero = self.arm.frames(np.zeros(self.arm.n))
        root = zero[0].inverse()
        places = [root @ frame for frame in zero[1:]]
        at = np.array([complex(*place.position[:2]) for place in places])
        signs = np.array([
            float(np.round((place.rotation @ each.axis)[2]))
            for place, each in zip(places[:-1], self.arm.joints, strict=True)
        ])  # fmt: skip
        count = len(goals)
        segments = np.tile(np.diff(at), (count, 1))
        target = goals[:, 0] + 1j * goals[:, 1] - at[0]
        angle = 2 * np.arctan2(goals[:, 6], goals[:, 3])
        angle = angle - 2 * np.arctan2(places[-1].quaternion[3], places[-1].quaternion[0])
        if joint is not None and values is not None:
            turn = np.exp(1j * signs[joint] * values)
            if joint:
                segments[:, joint - 1] += turn * segments[:, joint]
                segments[:, joint + 1 :] *= turn[:, None]
            else:
                target = target / turn - segments[:, 0]
            angle = angle - signs[joint] * values
            segments, signs = np.delete(segments, joint, axis=1), np.delete(signs, joint)
        q, ok = planar_angles(segments, target, angle if self._space.rigid else None)
        return q * signs, ok


def _odd(rows: Indices, count: int) -> Indices:
    return np.flatnonzero(np.bincount(rows, minlength=count) % 2)


def _distinct(rows: Indices, q: Array, same: float) -> tuple[Indices, Array]:
    """Postures of slices, each once, modulo turns, in order of the slices."""
    kept: list[int] = []
    points = np.exp(1j * q)
    for k in np.argsort(rows, kind="stable"):
        before = [j for j in kept[-32:] if rows[j] == rows[k]]
        if all(np.abs(points[j] - points[k]).max() > same for j in before):
            kept.append(int(k))
    return rows[kept], np.angle(points[kept])


def _turned_to(axis: Array) -> Array:
    """A rotation that turns z to an axis, (3, 3)."""
    x = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _matrix(pose: Pose) -> Array:
    """A pose as a homogeneous matrix, (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pose.rotation, pose.position
    return T
