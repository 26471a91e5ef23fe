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

    def in_motion(self, q, speed, gravity):
        """Torques of velocity and gravity, and the tip's J̇q̇ in world axes, (6,)."""
        model = self.model.copy()
        model.gravity.linear = self.origin.rotation.T @ np.array(gravity)
        data = model.createData()
        configuration = self.configuration(q)
        bias = pin.nonLinearEffects(model, data, configuration, speed)
        model.gravity.linear = np.zeros(3)
        data = model.createData()
        pin.forwardKinematics(model, data, configuration, speed, np.zeros(len(q)))
        lag = pin.getFrameClassicalAcceleration(
            model, data, self.tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        R = self.origin.rotation
        return np.array(bias), np.concatenate([R @ lag.linear, R @ lag.angular])


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

    def in_motion(self, q, speed, gravity):
        """The same as for a URDF: every point's centripetal acceleration, and what it takes."""
        start = math.atan2(self.base.rotation[1, 0], self.base.rotation[0, 0])
        angles, rates = start + np.cumsum(q), np.cumsum(speed)
        n = len(q)
        ends, lags = [np.zeros(2)], [np.zeros(2)]
        bias = np.zeros(n)
        for link, angle, rate in zip(self.links, angles, rates, strict=True):
            along = np.array([math.cos(angle), math.sin(angle)])
            com, lag = ends[-1] + link["com"] * along, lags[-1] - link["com"] * rate**2 * along
            force = link["mass"] * (lag - np.array(gravity[:2]))
            for j, joint in enumerate(ends):
                r = com - joint
                bias[j] += r[0] * force[1] - r[1] * force[0]
            lags.append(lags[-1] - link["length"] * rate**2 * along)
            ends.append(ends[-1] + link["length"] * along)
        return bias, np.array([*lags[-1], 0, 0, 0, 0])


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
        if self.tables.get("ellipsoid", {}).get("load_distribution") == "nonsqueezing":
            shares = [np.linalg.inv(self.W(table)) for table in self.tables["arms"]]
            W_pinv = np.vstack(shares) / len(shares)
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

    def limits(self) -> np.ndarray:
        """T: ones, or the torque limits of the file or the URDF."""
        parts = []
        for table in self.tables["arms"]:
            arm = self.arms[table["name"]]
            if self.tables.get("ellipsoid", {}).get("torque_scaling", "unit") == "unit":
                n = len(table["links"]) if "links" in table else arm.model.nv
                parts.append(np.ones(n))
            elif "torque_limits" in table:
                parts.append(np.array(table["torque_limits"], dtype=float))
            else:
                parts.append(np.array(arm.model.upperEffortLimit))
        return np.concatenate(parts)

    def constrained_dynamics(self, joints: dict):
        """(B, c): the object's acceleration is B τ + c, from the full equations of motion.

        M q̈ + b + Jᵀh = τ, J q̈ + J̇q̇ = Wᵀa + Ẇᵀv, W h = M_o a + c_o + g_o, solved as they stand.
        """
        m, rows = len(self.rows), self.rows
        settings = self.tables.get("ellipsoid", {})
        planar = self.space.startswith("planar")
        default = [0.0, 0.0] if planar else [0.0, 0.0, -9.81]
        gravity = np.array(self.tables.get("world", {}).get("gravity", default), dtype=float)
        gravity = np.array([*gravity, 0.0])[:3] * bool(settings.get("gravity", False))
        v = np.array(self.tables["object"].get("velocity", np.zeros(m)), dtype=float)
        full = np.zeros(6)
        full[rows] = v
        omega = full[3:]
        Ms, Js, Ws, bias, lags = [], [], [], [], []
        for table in self.tables["arms"]:
            arm, q = self.arms[table["name"]], np.array(joints[table["name"]])
            _, J, M, _ = arm.at(q)
            J, W = J[rows], self.W(table)
            speed = np.linalg.pinv(J) @ W.T @ v
            b, lag = arm.in_motion(q, speed, gravity)
            r = self.object.rotation @ pose(table["grasp"]).translation
            swing = np.concatenate([np.cross(omega, np.cross(omega, r)), np.zeros(3)])
            Ms.append(M)
            Js.append(J)
            Ws.append(W)
            bias.append(b)
            lags.append((swing - lag)[rows])
        import scipy.linalg

        M, J, W = scipy.linalg.block_diag(*Ms), scipy.linalg.block_diag(*Js), np.hstack(Ws)
        N, Km = len(M), len(J)
        system = np.zeros((N + Km + m, N + Km + m))
        system[:N, :N], system[:N, N : N + Km] = M, J.T
        system[N : N + Km, :N], system[N : N + Km, N + Km :] = J, -W.T
        system[N + Km :, N : N + Km], system[N + Km :, N + Km :] = W, -self.M_o
        inertia = np.zeros((6, 6))
        inertia[np.ix_(rows, rows)] = self.M_o
        weight = np.concatenate([-gravity * self.tables["object"]["mass"], np.zeros(3)])
        turning = np.concatenate([np.zeros(3), np.cross(omega, inertia[3:, 3:] @ omega)])
        right = np.concatenate(
            [-np.concatenate(bias), np.concatenate(lags), (weight + turning)[rows]]
        )
        torques = np.vstack([np.eye(N), np.zeros((Km + m, N))])
        solved = np.linalg.solve(system, np.column_stack([torques, right]))[N + Km :]
        return solved[:, :N], solved[:, N]

    def torque_limits(self) -> np.ndarray:
        """T of all joints, of the file or the URDF."""
        parts = [
            np.array(table["torque_limits"], dtype=float)
            if "torque_limits" in table
            else np.array(self.arms[table["name"]].model.upperEffortLimit)
            for table in self.tables["arms"]
        ]
        return np.concatenate(parts)

    def at_rest(self, joints: dict):
        """M, J, g, W and X of all arms, and g_o, as they stand in the equations of motion at rest.

        X is W with the moments of forces in the linear spaces, and g_o has a zero for each.
        """
        import scipy.linalg

        rows, planar = self.rows, self.space.startswith("planar")
        default = [0.0, 0.0] if planar else [0.0, 0.0, -9.81]
        gravity = np.array(self.tables.get("world", {}).get("gravity", default), dtype=float)
        gravity = np.array([*gravity, 0.0])[:3]
        balance = [0, 1, 5] if planar else [0, 1, 2, 3, 4, 5]
        Ms, Js, gs, Ws, Xs = [], [], [], [], []
        for table in self.tables["arms"]:
            arm, q = self.arms[table["name"]], np.array(joints[table["name"]])
            _, J, M, _ = arm.at(q)
            Ms.append(M)
            Js.append(J[rows])
            gs.append(arm.in_motion(q, np.zeros(len(q)), gravity)[0])
            full = np.eye(6)
            full[3:, :3] = skew(self.object.rotation @ pose(table["grasp"]).translation)
            Ws.append(self.W(table))
            Xs.append(full[np.ix_(balance, rows)])
        weight = np.concatenate([-gravity * self.tables["object"]["mass"], np.zeros(3)])[balance]
        return (
            scipy.linalg.block_diag(*Ms), scipy.linalg.block_diag(*Js), np.concatenate(gs),
            np.hstack(Ws), np.hstack(Xs), weight,
        )  # fmt: skip

    def ellipsoid(self, joints: dict):
        """(gram, center) of what the file asks for, with its slice."""
        settings = self.tables.get("ellipsoid", {})
        T = self.limits()
        B, center = self.constrained_dynamics(joints)
        if settings.get("resolution", "pseudoinverse") == "torque-optimal":
            factor = np.linalg.inv(np.linalg.qr((B * T).T)[1]).T
        else:
            factor = self.at(joints).factor / T[:, None]
        names = {
            "spatial": ["x", "y", "z", "roll", "pitch", "yaw"],
            "spatial-linear": ["x", "y", "z"],
            "planar": ["x", "y", "angle"],
            "planar-linear": ["x", "y"],
        }[self.space]
        axes = [names.index(a) for a in self.tables.get("objective", {}).get("axes", names)]
        return factor[:, axes], center[axes]

    def own_factor(self, name: str, joints: dict) -> np.ndarray:
        """A factor of the Gram matrix of one arm alone at its tip."""
        settings = self.tables.get("ellipsoid", {})
        index = list(self.arms).index(name)
        counts = [len(joints[arm]) for arm in self.arms]
        T = np.split(self.limits(), np.cumsum(counts)[:-1])[index]
        _, J, M, _ = self.arms[name].at(np.array(joints[name]))
        J = J[self.rows]
        if settings.get("resolution", "pseudoinverse") == "pseudoinverse":
            return M @ np.linalg.pinv(J) / T[:, None]
        return np.linalg.inv(np.linalg.qr((J @ np.linalg.inv(M) * T).T)[1]).T
