"""Independent truth: everything about a problem recomputed without a line of copose.

URDF arms go through Pinocchio, planar arms through the elementary sums over their links.
"""

from __future__ import annotations

import copy
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
    if "quaternion" in table:
        turn = pin.Quaternion(*map(float, table["quaternion"]))
        return pin.SE3(turn.toRotationMatrix(), np.array(table["position"], dtype=float))
    if "rpy" in table or len(table.get("position", [0, 0, 0])) == 3:
        rotation = pin.rpy.rpyToMatrix(*map(float, table.get("rpy", (0, 0, 0))))
        return pin.SE3(rotation, np.array(table.get("position", (0, 0, 0)), dtype=float))
    rotation = pin.rpy.rpyToMatrix(0.0, 0.0, float(table.get("angle", 0.0)))
    return pin.SE3(rotation, np.array([*table.get("position", (0, 0)), 0.0], dtype=float))


def placed(tables: dict, posture, case: dict | None = None) -> dict:
    """Tables with object, bases and grasps where a posture says they are, for a case if any.

    Nothing is free in them, and nothing fixed.
    """
    found = copy.deepcopy(tables)
    found.pop("cases", None)
    thing = found["object"]
    for key in ("freedom", "rpy", "angle", "quaternion"):
        thing.pop(key, None)
    thing |= posture.object.model_dump()
    if case is not None and "mass" in case:
        ratio = case["mass"] / thing["mass"]
        thing["mass"] = case["mass"]
        if "inertia" in thing:
            thing["inertia"] = (np.array(thing["inertia"]) * ratio).tolist()
    for arm in found["arms"]:
        arm.pop("freedom", None)
        arm.pop("fixed", None)
        for what in ("base", "grasp"):
            moved = getattr(posture, what) or {}
            if arm["name"] in moved:
                arm[what] = moved[arm["name"]].model_dump()
    return found


def offsets(pose: pin.SE3, shift: dict, *, of: str) -> pin.SE3:
    """A pose moved as a table ``freedom`` says: of a ``base``, or of a ``grasp``."""
    step = np.array([shift.get(name, 0.0) for name in "xyz"])
    turn = pin.utils.rotate("z", shift.get("yaw" if of == "base" else "twist", 0.0))
    rotation = turn @ pose.rotation if of == "base" else pose.rotation @ turn
    return pin.SE3(rotation, pose.translation + step)


def moved_object(table: dict, shift: dict) -> pin.SE3:
    """The object's pose moved as its table ``freedom`` says."""
    position = np.zeros(3)
    position[: len(table["position"])] = table["position"]
    position += [shift.get(name, 0.0) for name in "xyz"]
    rpy = np.array(table.get("rpy", (0.0, 0.0, table.get("angle", 0.0))), dtype=float)
    rpy += [shift.get(name, 0.0) for name in ("roll", "pitch", "yaw")]
    rpy[2] += shift.get("angle", 0.0)
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), position)


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


class PlanarPlaces:
    """Planar arms in many placements at once: log-volumes, closure, and all that closes.

    Free coordinates x, (count, d), are the object's, then each arm's base's and grasp's, in the
    order x, y, angle. Of joints q, (count, N), all arms' are stacked.
    """

    def __init__(self, tables: dict) -> None:
        self.tables = tables
        self.m = len(ROWS[tables["task"]["space"]])
        owners = [(None, "object", tables["object"].get("freedom", {}))]
        for i, arm in enumerate(tables["arms"]):
            freedom = arm.get("freedom", {})
            owners += [(i, what, freedom.get(what, {})) for what in ("base", "grasp")]
        self.free = [
            (owner, what, name, table[given])
            for owner, what, table in owners
            for name, words in (("x", "x"), ("y", "y"), ("angle", "angle yaw twist"))
            for given in words.split()
            if given in table
        ]
        self.low = np.array([limits[0] for *_, limits in self.free])
        self.high = np.array([limits[1] for *_, limits in self.free])
        self.edges = np.cumsum([0] + [len(arm["links"]) for arm in tables["arms"]])
        self.joint_limits = np.vstack(
            [
                arm.get("position_limits", [[-np.inf, np.inf]] * len(arm["links"]))
                for arm in tables["arms"]
            ]
        )

    def where(self, owner: int | None, what: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position, (count, 2), and angle, (count,), of the object, a base or a grasp."""
        table = self.tables["object"] if owner is None else self.tables["arms"][owner].get(what, {})
        place = np.zeros((len(x), 3))
        place += [*table.get("position", (0.0, 0.0)), table.get("angle", 0.0)]
        for k, (whose, kind, name, _) in enumerate(self.free):
            if (whose, kind) == (owner, what):
                place[:, ["x", "y", "angle"].index(name)] += x[:, k]
        return place[:, :2], place[:, 2]

    def goal(self, i: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where tip i should be, and how it should be turned."""
        at, turn = self.where(None, "object", x)
        grasp, angle = self.where(i, "grasp", x)
        return at + turned(grasp, turn), turn + angle

    def closure(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """What every arm misses its grasp by, (count, K·m)."""
        rows = []
        for i in range(len(self.tables["arms"])):
            (tip, angle), (goal, turn) = self.arm(i, q, x)[:2], self.goal(i, x)
            rows.append(tip - goal)
            if self.m == 3:
                rows.append(np.sin(angle - turn)[:, None])
        return np.hstack(rows)

    def arm(self, i: int, q: np.ndarray, x: np.ndarray):
        """Tip, its angle, Jacobian, (count, m, n), and joint inertia of arm i."""
        base, start = self.where(i, "base", x)
        angles = start[:, None] + np.cumsum(q[:, self.edges[i] : self.edges[i + 1]], axis=1)
        links, n = self.tables["arms"][i]["links"], angles.shape[1]
        along = np.stack([np.cos(angles), np.sin(angles)], axis=2)
        joints = [base]
        for k, link in enumerate(links):
            joints.append(joints[-1] + link["length"] * along[:, k])

        def jacobian(point, last):
            J = np.zeros((len(q), 3, n))
            for j in range(last + 1):
                J[:, 0, j], J[:, 1, j] = (
                    joints[j][:, 1] - point[:, 1],
                    point[:, 0] - joints[j][:, 0],
                )
                J[:, 2, j] = 1.0
            return J

        M = np.zeros((len(q), n, n))
        for k, link in enumerate(links):
            J = jacobian(joints[k] + link["com"] * along[:, k], k)
            weights = np.array([link["mass"], link["mass"], link["inertia"]])
            M += J.swapaxes(1, 2) @ (weights[:, None] * J)
        return joints[-1], angles[:, -1], jacobian(joints[-1], n - 1)[:, : self.m], M

    def own(self, i: int, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """What arm i adds to the Gram matrix, (count, m, m)."""
        m, K, thing = self.m, len(self.tables["arms"]), self.tables["object"]
        turn = self.where(None, "object", x)[1]
        W = np.tile(np.eye(m), (len(x), 1, K))
        if m == 3:
            for k in range(K):
                r = turned(self.where(k, "grasp", x)[0], turn)
                W[:, 2, 3 * k], W[:, 2, 3 * k + 1] = -r[:, 1], r[:, 0]
        mine = slice(m * i, m * i + m)
        M_o = np.diag([thing["mass"], thing["mass"], thing.get("inertia", 0.0)][:m])
        _, _, J, M = self.arm(i, q, x)
        A = M @ np.linalg.pinv(J) @ W[:, :, mine].swapaxes(1, 2)
        A += J.swapaxes(1, 2) @ np.linalg.pinv(W)[:, mine] @ M_o
        return A.swapaxes(1, 2) @ A

    def volume(self, gram: np.ndarray) -> np.ndarray:
        """The log-volume of Gram matrices, (..., m, m)."""
        G = gram
        if self.m == 2:
            det = G[..., 0, 0] * G[..., 1, 1] - G[..., 0, 1] ** 2
        else:
            det = (
                G[..., 0, 0] * (G[..., 1, 1] * G[..., 2, 2] - G[..., 1, 2] ** 2)
                - G[..., 0, 1] * (G[..., 0, 1] * G[..., 2, 2] - G[..., 1, 2] * G[..., 0, 2])
                + G[..., 0, 2] * (G[..., 0, 1] * G[..., 1, 2] - G[..., 1, 1] * G[..., 0, 2])
            )
        ball = self.m / 2 * math.log(math.pi) - math.lgamma(self.m / 2 + 1)
        return ball - 0.5 * np.log(det)

    def value(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The log-volume of postures, (count,)."""
        return self.volume(sum(self.own(i, q, x) for i in range(len(self.tables["arms"]))))

    def inverse(self, i: int, x: np.ndarray, around: int) -> np.ndarray:
        """All postures of arm i that hold the object at one x, (d,): (count, n).

        Two joints follow from the tip's place, a last one from how it is turned; the first of those
        left over is on a grid of so many angles.
        """
        links = [link["length"] for link in self.tables["arms"][i]["links"]]
        (goal,), (turn,) = self.goal(i, x[None])
        (base,), (start,) = self.where(i, "base", x[None])
        wrist, links = (
            (goal - links[-1] * np.array([math.cos(turn), math.sin(turn)]), links[:-1])
            if self.m == 3
            else (goal, links)
        )
        first = np.zeros((1, 0))
        if len(links) == 3:
            first = (np.arange(around) * 2 * math.pi / around)[:, None]
            base = base + links[0] * np.hstack([np.cos(start + first), np.sin(start + first)])
        assert len(links) - first.shape[1] == 2
        a, b = links[-2:]
        away = np.atleast_2d(wrist - base)
        cosine = ((away**2).sum(axis=1) - a**2 - b**2) / (2 * a * b)
        reach = np.abs(cosine) < 1
        first, away, cosine = first[reach], away[reach], cosine[reach]
        found = []
        for bend in (np.arccos(cosine), -np.arccos(cosine)):
            point = np.arctan2(away[:, 1], away[:, 0])
            shoulder = point - np.arctan2(b * np.sin(bend), a + b * np.cos(bend))
            shoulder = shoulder - start - first.sum(axis=1)
            parts = [first, shoulder[:, None], bend[:, None]]
            if self.m == 3:
                parts.append((turn - start - first.sum(axis=1) - shoulder - bend)[:, None])
            found.append(np.hstack(parts))
        q = np.vstack(found)
        limits = self.joint_limits[self.edges[i] : self.edges[i + 1]]
        q = (q + math.pi) % (2 * math.pi) - math.pi
        return q[np.all((q >= limits[:, 0]) & (q <= limits[:, 1]), axis=1)]

    def densest(self, grid: int, around: int, kept: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """The best postures (q, x) of a dense grid over all that is free, unlike each other."""
        ticks = [np.linspace(*limits, grid) for *_, limits in self.free]
        found = []
        for x in np.stack(np.meshgrid(*ticks), axis=-1).reshape(-1, len(ticks)):
            mine = [self.inverse(i, x, around) for i in range(2)]
            if any(len(q) == 0 for q in mine):
                continue
            grams = []
            for i, q in enumerate(mine):
                whole = np.zeros((len(q), self.edges[-1]))
                whole[:, self.edges[i] : self.edges[i + 1]] = q
                grams.append(self.own(i, whole, np.tile(x, (len(q), 1))))
            with np.errstate(all="ignore"):
                values = self.volume(grams[0][:, None] + grams[1][None])
            values[~np.isfinite(values)] = -np.inf
            for flat in np.argsort(-values, axis=None)[: 2 * kept]:
                a, b = np.unravel_index(flat, values.shape)
                found.append((values[a, b], np.concatenate([mine[0][a], mine[1][b]]), x))
        found.sort(key=lambda each: -each[0])
        chosen: list[tuple[np.ndarray, np.ndarray]] = []
        span = self.high - self.low
        for _, q, x in found:
            if len(chosen) == kept:
                break
            if all(
                np.abs(np.sin((q - p) / 2)).max() > 0.15 or np.abs((x - y) / span).max() > 0.2
                for p, y in chosen
            ):
                chosen.append((q, x))
        return chosen

    def polished(self, q: np.ndarray, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """The local optimum over joints and all that is free, by SciPy, and where it is."""
        from scipy.optimize import minimize

        N = len(q)
        low = np.concatenate([self.joint_limits[:, 0], self.low])
        high = np.concatenate([self.joint_limits[:, 1], self.high])

        def many(function, z):
            return function(z[:, :N], z[:, N:])

        def slope(function):
            def of(z):
                steps = 1e-6 * np.eye(len(z))
                ends = many(function, np.vstack([z + steps, z - steps]))
                return ((ends[: len(z)] - ends[len(z) :]) / 2e-6).T

            return of

        end = minimize(
            lambda z: -many(self.value, z[None])[0],
            np.concatenate([q, x]),
            jac=lambda z: -slope(self.value)(z),
            bounds=np.column_stack([low, high]),
            constraints={
                "type": "eq",
                "fun": lambda z: many(self.closure, z[None])[0],
                "jac": slope(self.closure),
            },
            method="SLSQP",
            options={"maxiter": 300, "ftol": 1e-11},
        )
        z = np.clip(end.x, low, high)
        closed = np.abs(many(self.closure, z[None])).max() < 1e-7
        return (float(-end.fun) if closed else -np.inf), z[:N], z[N:]


def turned(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Vectors in the plane, (count, 2), turned by angles, (count,)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.column_stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]]
    )
