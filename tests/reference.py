"""Independent truth: everything about a problem recomputed without a line of copose.

URDF arms go through Pinocchio, planar arms through the elementary sums over their links.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

PROBLEMS = Path(__file__).parents[1] / "problems"
ROWS = {
    "spatial": [0, 1, 2, 3, 4, 5],
    "spatial-linear": [0, 1, 2],
    "planar": [0, 1, 5],
    "planar-linear": [0, 1],
}


def example(path: str) -> Path:
    """A file of example-robot-data, found from where Pinocchio is installed."""
    prefix = Path(pin.__file__).parents[4]
    return prefix / "share/example-robot-data/robots" / path


def skew(r):
    x, y, z = r
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def pose(table: dict) -> pin.SE3:
    if "rpy" in table or len(table.get("position", [0, 0, 0])) == 3:
        rotation = pin.rpy.rpyToMatrix(*map(float, table.get("rpy", (0, 0, 0))))
        return pin.SE3(rotation, np.array(table.get("position", (0, 0, 0)), dtype=float))
    rotation = pin.rpy.rpyToMatrix(0.0, 0.0, float(table.get("angle", 0.0)))
    return pin.SE3(rotation, np.array([*table.get("position", (0, 0)), 0.0], dtype=float))


class UrdfArm:
    """One ``[[arms]]`` table by Pinocchio."""

    def __init__(self, table: dict, free: list[str]) -> None:
        path = example(table["urdf"].removeprefix("example-robot-data://"))
        full = pin.buildModelFromUrdf(str(path))
        q0 = pin.neutral(full)
        for name, value in table.get("locked", {}).items():
            joint = full.joints[full.getJointId(name)]
            q0[joint.idx_q : joint.idx_q + joint.nq] = (
                [math.cos(value), math.sin(value)] if joint.nq == 2 else [value]
            )
        lock = [i for i in range(1, full.njoints) if full.names[i] not in free]
        self.model = pin.buildReducedModel(full, lock, q0)
        assert list(self.model.names)[1:] == free
        self.tip = self.model.getFrameId(table["tip"], pin.FrameType.BODY)
        tool = table.get("tool")
        if tool is not None:
            inertia = np.array(tool["inertia"], dtype=float)
            inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
            body = pin.Inertia(tool["mass"], np.array(tool["com"], dtype=float), inertia)
            self.model.appendBodyToJoint(
                self.model.frames[self.tip].parentJoint, body, self.model.frames[self.tip].placement
            )
        data = self.model.createData()
        root = table.get("root")
        universe_root = pin.SE3.Identity()
        if root is not None:
            pin.framesForwardKinematics(self.model, data, pin.neutral(self.model))
            universe_root = data.oMf[self.model.getFrameId(root, pin.FrameType.BODY)].copy()
        self.origin = pose(table.get("base", {})) * universe_root.inverse()
        self.armature = np.array(table.get("armature", [0.0] * len(free)))

    def configuration(self, q):
        out = []
        for joint, value in zip(list(self.model.joints)[1:], q, strict=True):
            out += [math.cos(value), math.sin(value)] if joint.nq == 2 else [value]
        return np.array(out)

    def at(self, q, gravity=(0.0, 0.0, -9.81)):
        """Tip pose, Jacobian, joint inertia and gravity torques, world axes."""
        configuration = self.configuration(q)
        data = self.model.createData()
        J = pin.computeFrameJacobian(
            self.model, data, configuration, self.tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        pin.framesForwardKinematics(self.model, data, configuration)
        M = np.array(pin.crba(self.model, data, configuration))
        M = np.triu(M) + np.triu(M, 1).T + np.diag(self.armature)
        model = self.model.copy()
        model.gravity.linear = self.origin.rotation.T @ np.array(gravity)
        g = pin.computeGeneralizedGravity(model, model.createData(), configuration)
        R = self.origin.rotation
        J = np.vstack([R @ J[:3], R @ J[3:]])
        return self.origin * data.oMf[self.tip], J, M, np.array(g)


class PlanarArm:
    """One planar ``[[arms]]`` table by sums over its links."""

    def __init__(self, table: dict) -> None:
        self.links = table["links"]
        self.base = pose(table.get("base", {}))
        self.armature = np.array(table.get("armature", [0.0] * len(self.links)))

    def at(self, q):
        start = math.atan2(self.base.rotation[1, 0], self.base.rotation[0, 0])
        angles = start + np.cumsum(q)
        ends = [self.base.translation[:2]]
        for link, angle in zip(self.links, angles, strict=True):
            ends.append(ends[-1] + link["length"] * np.array([math.cos(angle), math.sin(angle)]))
        n = len(q)

        def jacobian(point, last):
            J = np.zeros((6, n))
            for j in range(last + 1):
                r = point - ends[j]
                J[:, j] = [-r[1], r[0], 0, 0, 0, 1]
            return J

        M = np.diag(self.armature).astype(float)
        for k, (link, angle) in enumerate(zip(self.links, angles, strict=True)):
            com = ends[k] + link["com"] * np.array([math.cos(angle), math.sin(angle)])
            J = jacobian(com, k)
            M += link["mass"] * J[:2].T @ J[:2] + link["inertia"] * np.outer(J[5], J[5])
        rotation = pin.rpy.rpyToMatrix(0.0, 0.0, float(angles[-1]))
        tip = pin.SE3(rotation, np.array([*ends[-1], 0.0]))
        return tip, jacobian(ends[-1], n - 1), M, None


@dataclass
class Recomputed:
    gram: np.ndarray
    factor: np.ndarray
    closure: dict[str, float]
    own: dict[str, np.ndarray]

    @property
    def radii(self):
        return 1 / np.linalg.svd(self.factor, compute_uv=False)[::-1]

    @property
    def log_volume(self):
        m = len(self.gram)
        ball = m / 2 * math.log(math.pi) - math.lgamma(m / 2 + 1)
        return float(ball + np.sum(np.log(self.radii)))


class Problem:
    """A problem file's tables, and everything that follows from joints."""

    def __init__(self, tables: dict | str | Path, names: dict[str, list[str]] | None = None):
        if not isinstance(tables, dict):
            tables = tomllib.loads(Path(tables).read_text())
        self.tables = tables
        self.space = tables["task"]["space"]
        self.rows = ROWS[self.space]
        self.arms = {}
        for table in tables["arms"]:
            self.arms[table["name"]] = (
                PlanarArm(table) if "links" in table else UrdfArm(table, names[table["name"]])
            )
        thing = tables["object"]
        self.object = pose(thing)
        inertia = np.array(thing.get("inertia", 0.0), dtype=float)
        inertia = np.eye(3) * inertia if inertia.ndim == 0 else inertia
        inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        R = self.object.rotation
        full = np.zeros((6, 6))
        full[:3, :3] = thing["mass"] * np.eye(3)
        full[3:, 3:] = R @ inertia @ R.T
        self.M_o = full[np.ix_(self.rows, self.rows)]

    def W(self, table: dict) -> np.ndarray:
        full = np.eye(6)
        full[3:, :3] = skew(self.object.rotation @ pose(table["grasp"]).translation)
        return full[np.ix_(self.rows, self.rows)]

    def at(self, joints: dict) -> Recomputed:
        m = len(self.rows)
        W = np.hstack([self.W(table) for table in self.tables["arms"]])
        W_pinv = np.linalg.pinv(W)
        blocks, closure, own = [], {}, {}
        for i, table in enumerate(self.tables["arms"]):
            name = table["name"]
            tip, J, M, _ = self.arms[name].at(np.array(joints[name]))
            J = J[self.rows]
            own[name] = M @ np.linalg.pinv(J)
            blocks.append(
                own[name] @ W[:, m * i : m * i + m].T + J.T @ W_pinv[m * i : m * i + m] @ self.M_o
            )
            goal = self.object * pose(table["grasp"])
            gap = float(np.linalg.norm(tip.translation - goal.translation))
            angle = float(np.linalg.norm(pin.log3(goal.rotation.T @ tip.rotation)))
            closure[name] = max(gap, angle) if m in (6,) or self.space == "planar" else gap
        A = np.vstack(blocks)
        return Recomputed(A.T @ A, A, closure, own)
