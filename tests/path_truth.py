"""Whether a motion is what it says: all recomputed from its numbers and the problem's tables.

Arms and formulas are those of `reference`, the object's law that of `object_path`; nothing here
asks copose, but for objectives that are no functions of an ellipsoid.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import scipy.linalg

from object_path import Moving, ObjectPath
from reference import Problem as Reference
from reference import pose, skew

CLOSED = 1e-8
SPEED, RATE = 1e-7, 1e-6  # of contacts, m/s and m/s²
DYNAMICS = 1e-6
BEYOND = 1e-9  # of positions, rad
SHARE = 1e-6  # of limits of speed, acceleration and torque
SAMPLES = 9  # between two knots


@dataclass(frozen=True)
class Contact:
    """Everything about an arm at a moment; rows of the task space."""

    gap: float
    J: np.ndarray
    M: np.ndarray
    bias: np.ndarray
    lag: np.ndarray
    W: np.ndarray
    X: np.ndarray
    swing: np.ndarray


class PathTruth:
    """A problem with a path, by arms, and where its object is.

    Attributes:
        tables: of the problem.
        names: joint names by arm.
        path: the object's law.
    """

    def __init__(self, tables: dict, names: dict[str, list[str]], duration: float) -> None:
        self.tables, self.names = tables, names
        self.path = ObjectPath(tables, duration)
        self.reference = Reference(tables, names)
        self.rows, self.space = self.reference.rows, self.reference.space
        self.rigid = self.space in ("spatial", "planar")
        self.balance = [0, 1, 5] if self.space.startswith("planar") else [0, 1, 2, 3, 4, 5]
        flat = self.space.startswith("planar")
        given = tables.get("world", {}).get("gravity", [0.0, 0.0] if flat else [0.0, 0.0, -9.81])
        self.gravity = np.array([*given, 0.0], dtype=float)[:3]
        inertia = np.array(tables["object"].get("inertia", 0.0), dtype=float)
        if inertia.ndim == 0:
            inertia = np.diag([0.0, 0.0, float(inertia)])
        self.inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
        self.mass = float(tables["object"]["mass"])

    def place(self, now: Moving) -> None:
        """Let the reference have its object there."""
        reference = self.reference
        reference.object = pin.SE3(now.rotation, now.position)
        full = self.object_inertia(now)
        reference.M_o = full[np.ix_(self.rows, self.rows)]

    def object_inertia(self, now: Moving) -> np.ndarray:
        """Mass and inertia about the centre of mass, world axes, 6 × 6."""
        full = np.zeros((6, 6))
        full[:3, :3] = self.mass * np.eye(3)
        full[3:, 3:] = now.rotation @ self.inertia @ now.rotation.T
        return full

    def contact(self, table: dict, q: np.ndarray, speed: np.ndarray, now: Moving) -> Contact:
        """An arm in motion beside the object in motion."""
        arm = self.reference.arms[table["name"]]
        tip, J, M, _ = arm.at(q)
        bias, lag = arm.in_motion(q, speed, self.gravity)
        goal = pin.SE3(now.rotation, now.position) * pose(table["grasp"])
        r = now.rotation @ pose(table["grasp"]).translation
        full = np.eye(6)
        full[3:, :3] = skew(r)
        swing = np.concatenate([np.cross(now.omega, np.cross(now.omega, r)), np.zeros(3)])
        return Contact(
            self.gap(tip, goal), J[self.rows], M, bias, lag[self.rows],
            full[np.ix_(self.rows, self.rows)], full[np.ix_(self.balance, self.rows)],
            swing[self.rows],
        )  # fmt: skip

    def gap(self, tip: pin.SE3, goal: pin.SE3) -> float:
        """The larger of m and rad, with rigid grasps; else m."""
        apart = float(np.linalg.norm(tip.translation - goal.translation))
        turned = float(np.linalg.norm(pin.log3(goal.rotation.T @ tip.rotation)))
        return max(apart, turned) if self.rigid else apart

    def tip_gap(self, table: dict, q: np.ndarray, now: Moving) -> float:
        """What an arm misses its grasp by."""
        goal = pin.SE3(now.rotation, now.position) * pose(table["grasp"])
        return self.gap(self.reference.arms[table["name"]].at(q)[0], goal)

    def contacts(self, joints: dict, speeds: dict, now: Moving) -> list[Contact]:
        """All arms."""
        return [
            self.contact(
                arm, np.array(joints[arm["name"]]), np.array(speeds[arm["name"]]), now
            )
            for arm in self.tables["arms"]
        ]  # fmt: skip

    def wrench(self, now: Moving) -> np.ndarray:
        """What the contacts must do to the object: forces over moments, in rows of balance."""
        inertia = self.object_inertia(now)
        rate = np.concatenate([now.acceleration - self.gravity, now.alpha])
        turning = np.cross(now.omega, inertia[3:, 3:] @ now.omega)
        return (inertia @ rate + np.concatenate([np.zeros(3), turning]))[self.balance]

    def torques(self, contacts: list[Contact], rates: list[np.ndarray], now: Moving):
        """Torques that give the joint accelerations, their norm the smallest; and what is missing.

        τ = M q̈ + b + Jᵀh with X h the object's wrench; the wrench that X h falls short of comes
        second.
        """
        free = np.concatenate(
            [c.M @ rate + c.bias for c, rate in zip(contacts, rates, strict=True)]
        )
        J = scipy.linalg.block_diag(*[c.J for c in contacts])
        X = np.hstack([c.X for c in contacts])
        wanted = self.wrench(now)
        h = np.linalg.lstsq(X, wanted, rcond=1e-10)[0]
        N = scipy.linalg.null_space(X, rcond=1e-10)
        if N.shape[1]:
            h = h - N @ np.linalg.lstsq(J.T @ N, free + J.T @ h, rcond=None)[0]
        return free + J.T @ h, float(np.abs(X @ h - wanted).max())

    def forward(self, contacts: list[Contact], torque: np.ndarray, now: Moving):
        """Joint accelerations and the object's, under torques: the closed chain's own dynamics.

        M q̈ + b + Jᵀh = τ, J q̈ + J̇q̇ = Xᵀ(a, α) + ω × (ω × r), X h = (m (a − g), I α + ω × I ω),
        solved as they stand. What they leave open (an object that spins between two points) is zero
        in the third result, a basis of which comes last.
        """
        M = scipy.linalg.block_diag(*[c.M for c in contacts])
        J = scipy.linalg.block_diag(*[c.J for c in contacts])
        X = np.hstack([c.X for c in contacts])
        n, k, b = len(M), len(J), len(self.balance)
        inertia = self.object_inertia(now)
        turning = np.cross(now.omega, inertia[3:, 3:] @ now.omega)
        still = np.concatenate([-self.mass * self.gravity, turning])[self.balance]
        K = np.zeros((n + k + b, n + k + b))
        K[:n, :n], K[:n, n : n + k] = M, J.T
        K[n : n + k, :n], K[n : n + k, n + k :] = J, -X.T
        K[n + k :, n : n + k] = X
        K[n + k :, n + k :] = -inertia[np.ix_(self.balance, self.balance)]
        right = np.concatenate(
            [torque - np.concatenate([c.bias for c in contacts]),
             np.concatenate([c.swing - c.lag for c in contacts]), still]
        )  # fmt: skip
        U, s, Vt = np.linalg.svd(K)
        full = s > 1e-11 * s[0]
        found = Vt[full].T @ ((U[:, full].T @ right) / s[full])
        return found[:n], found[n + k :], Vt[~full][:, n + k :]

    def limits(self, name: str) -> dict[str, np.ndarray]:
        """Lower and upper positions, margin kept, speeds, accelerations and torques of an arm."""
        (table,) = [arm for arm in self.tables["arms"] if arm["name"] == name]
        n = len(self.names[name])
        none = np.full(n, np.inf)
        found = {"lower": -none, "upper": none, "velocity": none, "torque": none}
        if "urdf" in table:
            model = self.reference.arms[name].model
            for k, joint in enumerate(list(model.joints)[1:]):
                endless = joint.nq == 2
                found["lower"] = found["lower"].copy()
                found["upper"] = found["upper"].copy()
                if not endless:
                    found["lower"][k] = model.lowerPositionLimit[joint.idx_q]
                    found["upper"][k] = model.upperPositionLimit[joint.idx_q]
            for key, values in (
                ("velocity", model.upperVelocityLimit), ("torque", model.upperEffortLimit),
            ):  # fmt: skip
                values = np.array(values)
                found[key] = np.where((values > 0) & (values < 1e30), values, np.inf)
        if "position_limits" in table:
            found["lower"], found["upper"] = np.array(table["position_limits"], dtype=float).T
        for key in ("velocity", "acceleration", "torque"):
            if f"{key}_limits" in table:
                found[key] = np.array(table[f"{key}_limits"], dtype=float)
        margin = self.tables.get("constraints", {}).get("joint_margin", 0.0)
        found["lower"], found["upper"] = found["lower"] + margin, found["upper"] - margin
        return {"acceleration": none} | found

    def value(self, joints: dict, now: Moving) -> float | None:
        """The objective at a posture, None where it is none of an ellipsoid."""
        wanted = self.tables.get("objective", {})
        self.place(now)
        factor, _ = self.reference.ellipsoid(joints)
        radii = 1 / np.linalg.svd(factor, compute_uv=False)
        kind, a = wanted.get("kind", "volume"), len(radii)
        if kind == "volume":
            ball = a / 2 * math.log(math.pi) - math.lgamma(a / 2 + 1)
            return float(ball + np.log(radii).sum())
        if kind == "worst-direction":
            return float(radii.min())
        if kind == "isotropy":
            return float(radii.min() / radii.max())
        if kind == "task-compatibility":
            total = 0.0
            for each in wanted["directions"]:
                u = np.array(each["direction"], dtype=float)
                u /= np.linalg.norm(u)
                total -= each.get("weight", 1.0) * math.log(np.linalg.norm(factor @ u))
            return total
        return None


def hermite(q, q_next, v, v_next, span: float, x: float):
    """The cubic at x = 0 … 1 of a span in seconds: positions and speeds."""
    position = (
        (1 + 2 * x) * (1 - x) ** 2 * q
        + x * (1 - x) ** 2 * span * v
        + x**2 * (3 - 2 * x) * q_next
        + x**2 * (x - 1) * span * v_next
    )
    speed = (
        6 * x * (x - 1) * (q - q_next) / span + (1 - x) * (1 - 3 * x) * v + x * (3 * x - 2) * v_next
    )
    return position, speed


def roughness(motion: dict) -> float:
    """S: the mean over intervals and joints of ((q[k+1] − q[k]) / Δt)²."""
    q = stacked(motion, "joints")
    return float(np.mean((np.diff(q, axis=0) / np.diff(motion["time"])[:, None]) ** 2))


def stacked(motion: dict, key: str) -> np.ndarray:
    """Joints, velocities, accelerations or torques of all arms, (knots, N)."""
    return np.array(
        [np.concatenate([knot[key][arm] for arm in motion["joint_names"]])
         for knot in motion["knots"]]
    )  # fmt: skip


def faults(tables: dict, motion: dict) -> list[str]:
    """What is wrong with a solved motion, as JSON has it; empty where nothing is."""
    if motion["status"] != "solved":
        return [f"status is {motion['status']}: {motion['reason']}"]
    found = _form(tables, motion)
    if found:
        return found
    truth = PathTruth(tables, motion["joint_names"], motion["time"][-1])
    moments = [truth.path.at(t) for t in motion["time"]]
    return [
        *_places(truth, motion, moments),
        *_closure(truth, motion, moments),
        *_between(truth, motion),
        *_kinematics(truth, motion, moments),
        *_limits(truth, motion),
        *_objective(truth, motion, moments),
        *_dynamics(truth, motion, moments),
    ]


def _form(tables: dict, motion: dict) -> list[str]:
    found, path = [], tables["path"]
    asked = path.get("knots", 50)
    doubled = [(asked - 1) * 2**k + 1 for k in range(12)]
    time = np.array(motion["time"])
    if len(time) not in doubled:
        found.append(f"{len(time)} knots; asked for {asked}")
    if len(motion["knots"]) != len(time):
        found.append("times and knots differ in number")
    duration = path.get("duration", 2.0)
    if duration == "shortest":
        duration = time[-1]
    if time[0] != 0 or abs(time[-1] - duration) > 1e-12 * max(1.0, duration):
        found.append(f"time runs from {time[0]} to {time[-1]}, not to {duration}")
    if motion["duration"] is None or abs(motion["duration"] - duration) > 1e-12 * duration:
        found.append(f"duration is told as {motion['duration']}, not {duration}")
    if np.abs(np.diff(time) - time[-1] / (len(time) - 1)).max() > 1e-12 * max(1.0, time[-1]):
        found.append("times are not uniform")
    for key in ("joints", "velocity", "acceleration"):
        if not np.all(np.isfinite(stacked(motion, key))):
            found.append(f"{key} are not finite")
    return found


def _places(truth: PathTruth, motion: dict, moments: list[Moving]) -> list[str]:
    found = []
    for k, (knot, now) in enumerate(zip(motion["knots"], moments, strict=True)):
        told = pose(knot["object"])
        off = np.linalg.norm(told.translation - now.position)
        turn = np.linalg.norm(pin.log3(told.rotation.T @ now.rotation))
        if max(off, turn) > 1e-9:
            found.append(f"knot {k}: the object is told {off:.1e} m, {turn:.1e} rad off its path")
    return found


def _closure(truth: PathTruth, motion: dict, moments: list[Moving]) -> list[str]:
    found = []
    for k, (knot, now) in enumerate(zip(motion["knots"], moments, strict=True)):
        for table in truth.tables["arms"]:
            name = table["name"]
            gap = truth.tip_gap(table, np.array(knot["joints"][name]), now)
            if gap > CLOSED:
                found.append(f"knot {k}: {name} is open by {gap:.1e}")
            told = knot.get("closure_error", {}).get(name)
            if told is not None and abs(told - gap) > 1e-9:
                found.append(f"knot {k}: {name}'s closure error is told as {told:.1e}: {gap:.1e}")
    return found


def _between(truth: PathTruth, motion: dict) -> list[str]:
    found, worst = [], 0.0
    allowed = truth.tables["path"].get("tolerance", 1e-4)
    for k, (t, t_next) in enumerate(itertools.pairwise(motion["time"])):
        a, b = motion["knots"][k], motion["knots"][k + 1]
        for x in np.arange(1, SAMPLES + 1) / (SAMPLES + 1):
            now = truth.path.at(t + x * (t_next - t))
            for table in truth.tables["arms"]:
                n = table["name"]
                ends = (np.array(each[n]) for each in
                        (a["joints"], b["joints"], a["velocity"], b["velocity"]))  # fmt: skip
                gap = truth.tip_gap(table, hermite(*ends, t_next - t, x)[0], now)
                worst = max(worst, gap)
                if gap > allowed:
                    found.append(f"between knots {k} and {k + 1}: {n} is open by {gap:.1e}")
    told = motion["between_knots_error"]
    if told is None or worst > 1.1 * told + 1e-9 or told > allowed:
        found.append(f"between knots the chain opens by {worst:.2e}; told: {told}")
    return found


def _kinematics(truth: PathTruth, motion: dict, moments: list[Moving]) -> list[str]:
    found, rows = [], truth.rows
    for k, (knot, now) in enumerate(zip(motion["knots"], moments, strict=True)):
        contacts = truth.contacts(knot["joints"], knot["velocity"], now)
        for table, c in zip(truth.tables["arms"], contacts, strict=True):
            name = table["name"]
            r = now.rotation @ pose(table["grasp"]).translation
            twist = np.concatenate([now.velocity + np.cross(now.omega, r), now.omega])[rows]
            off = np.abs(c.J @ knot["velocity"][name] - twist).max()
            if off > SPEED:
                found.append(f"knot {k}: {name}'s contact is {off:.1e} m/s or rad/s off")
            rate = np.concatenate([now.acceleration + np.cross(now.alpha, r), now.alpha])[rows]
            off = np.abs(c.J @ knot["acceleration"][name] + c.lag - rate - c.swing).max()
            if off > RATE * max(1.0, np.abs(rate).max()):
                found.append(f"knot {k}: {name}'s contact is {off:.1e} m/s² or rad/s² off")
    for k in (0, -1):
        fastest = np.abs(stacked(motion, "velocity")[k]).max()
        if fastest > 1e-9:
            found.append(f"joints move with {fastest:.1e} rad/s at {'the end' if k else 'first'}")
    if truth.tables["path"].get("closed", False):
        q = stacked(motion, "joints")
        if np.abs(q[-1] - q[0]).max() > 1e-8:
            found.append("the motion does not end where it began")
    return found


def _limits(truth: PathTruth, motion: dict) -> list[str]:
    found = []
    times = np.diff(motion["time"])[:, None]
    dynamic = truth.tables.get("constraints", {}).get("dynamic_torque")
    if dynamic is None:
        # Left out it counts where the shortest time is sought, for joints that have a limit.
        dynamic = truth.tables["path"].get("duration") == "shortest"
    for name in motion["joint_names"]:
        limits = truth.limits(name)

        def of(key: str, arm: str = name) -> np.ndarray:
            return np.array([knot[key][arm] for knot in motion["knots"]])

        q, v, a = of("joints"), of("velocity"), of("acceleration")
        excess = {
            "position": np.maximum(limits["lower"] - q, q - limits["upper"]).max(),
            "speed": (np.abs(v) / limits["velocity"] - 1).max(),
            "speed between knots": (
                np.abs(np.diff(q, axis=0) / times) / limits["velocity"] - 1
            ).max(),
            "acceleration": (np.abs(a) / limits["acceleration"] - 1).max(),
        }
        if dynamic:
            excess["torque"] = (np.abs(of("torque")) / limits["torque"] - 1).max()
        for what, value in excess.items():
            slack = BEYOND if what == "position" else SHARE
            if value > slack:
                found.append(f"{name} is {value:.1e} beyond its limit of {what}")
        for k, told in enumerate(motion["limits"][name]):
            margin = truth.tables.get("constraints", {}).get("joint_margin", 0.0)
            for key, value in limits.items():
                value = value[k]
                # What is told may leave the margin out.
                shift = {"lower": -margin, "upper": margin}.get(key, 0.0)
                want = [None, None] if np.isinf(value) else [value, value + shift]
                if not any(
                    told[key] is w if w is None else told[key] is not None
                    and abs(told[key] - w) < 1e-9
                    for w in want
                ):  # fmt: skip
                    found.append(f"{name}, joint {k}: limit {key} is told as {told[key]}: {value}")
    return found


def _objective(truth: PathTruth, motion: dict, moments: list[Moving]) -> list[str]:
    found, values = [], []
    for k, (knot, now) in enumerate(zip(motion["knots"], moments, strict=True)):
        value = truth.value(knot["joints"], now)
        values.append(knot["objective"] if value is None else value)
        if value is None:
            continue
        if knot["objective"] is None or abs(knot["objective"] - value) > 1e-8 * max(1, abs(value)):
            found.append(f"knot {k}: objective is told as {knot['objective']}: {value}")
    mode = truth.tables["path"].get("aggregate", "mean")
    aggregate = float(np.min(values) if mode == "worst" else np.mean(values))
    told = motion["objective"]["after"]
    if told is None or abs(told - aggregate) > 1e-8 * max(1.0, abs(aggregate)):
        found.append(f"the aggregate is told as {told}: {aggregate}")
    S = roughness(motion)
    if motion["smoothness"] is None or abs(motion["smoothness"] - S) > 1e-9 * max(1.0, S):
        found.append(f"S is told as {motion['smoothness']}: {S}")
    if motion["aggregate"] != mode:
        found.append(f"the aggregate is told to be {motion['aggregate']}: {mode}")
    return found


def _dynamics(truth: PathTruth, motion: dict, moments: list[Moving]) -> list[str]:
    found, arms, missing = [], list(motion["joint_names"]), []
    for k, (knot, now) in enumerate(zip(motion["knots"], moments, strict=True)):
        contacts = truth.contacts(knot["joints"], knot["velocity"], now)
        rates = [np.array(knot["acceleration"][arm]) for arm in arms]
        if knot["torque"] is None:
            missing.append(truth.torques(contacts, rates, now)[1])
            continue
        torque = np.concatenate([knot["torque"][arm] for arm in arms])
        q, o, open_ = truth.forward(contacts, torque, now)
        rate = np.concatenate(rates)
        off = np.abs(q - rate).max() / max(1.0, np.abs(rate).max())
        if not off <= DYNAMICS:
            found.append(f"knot {k}: under its torques the joints' rates are {off:.1e} others")
        asked = np.concatenate([now.acceleration, now.alpha])[truth.balance]
        apart = o - asked
        if len(open_):
            basis = scipy.linalg.orth(open_.T)
            apart = apart - basis @ (basis.T @ apart)
        off = np.abs(apart).max() / max(1.0, np.abs(asked).max())
        if not off <= DYNAMICS:
            found.append(f"knot {k}: under its torques the object's rates are {off:.1e} others")
    # A motion whose object contact wrenches cannot carry somewhere has no torques anywhere.
    if missing and max(missing) < 1e-6:
        found.append("no torques are told, though contact wrenches carry the object")
    if 0 < len(missing) < len(moments):
        found.append("torques are told at some knots and not at others")
    return found
