"""Motions that no planner made: least-norm tracking with everything that a result tells."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import scipy.linalg
from baselines_path import Tracked, Tracker

from object_path import ObjectPath
from path_truth import PathTruth, roughness

_STEP = 1e-4


def split(names: dict[str, list[str]], x: np.ndarray) -> dict[str, list[float]]:
    """Stacked numbers by arm."""
    parts = np.split(np.asarray(x), np.cumsum([len(each) for each in names.values()])[:-1])
    return {arm: part.tolist() for arm, part in zip(names, parts, strict=True)}


def motion_of(tables: dict, names: dict[str, list[str]], tracked: Tracked, tracker: Tracker):
    """A tracked motion as `result.json` has it, as far as `path_truth` reads."""
    truth = PathTruth(tables, names, tracker.path.duration)
    path: ObjectPath = truth.path
    knots = []
    for time, q in zip(tracker.time, tracked.q, strict=True):
        now = path.at(time)
        speed = tracker.speeds(q, time)
        rates = _rates(truth, names, tracker, q, speed, time)
        parts = split(names, q)
        contacts = truth.contacts(parts, split(names, speed), now)
        by_arm = [np.array(each) for each in split(names, rates).values()]
        torque, missing = truth.torques(contacts, by_arm, now)
        quaternion = pin.Quaternion(now.rotation)
        place = {"position": now.position[: 2 if path.planar else 3].tolist()}
        if path.planar:
            place["angle"] = math.atan2(now.rotation[1, 0], now.rotation[0, 0])
        else:
            place["quaternion"] = [quaternion.w, quaternion.x, quaternion.y, quaternion.z]
        knots.append({
            "joints": parts, "object": place,
            "closure_error": {a: c.gap for a, c in zip(names, contacts, strict=True)},
            "objective": truth.value(parts, now), "velocity": split(names, speed),
            "acceleration": split(names, rates),
            "torque": split(names, torque) if missing < 1e-8 else None,
        })  # fmt: skip
    values = [knot["objective"] for knot in knots]
    mode = tables["path"].get("aggregate", "mean")
    motion = {
        "status": "solved", "reason": None, "joint_names": names, "knots": knots,
        "objective": {"after": float(np.mean(values) if mode == "mean" else np.min(values))},
        "aggregate": mode, "duration": path.duration, "time": tracker.time.tolist(),
        "between_knots_error": tables["path"].get("tolerance", 1e-4),
        "limits": {arm: _limits(truth, arm) for arm in names},
    }  # fmt: skip
    return motion | {"smoothness": roughness(motion)}


def _limits(truth: PathTruth, arm: str) -> list[dict]:
    limits = {
        key: [None if np.isinf(v) else float(v) for v in values]
        for key, values in truth.limits(arm).items()
    }
    return [
        {key: values[k] for key, values in limits.items()} for k in range(len(truth.names[arm]))
    ]


def _rates(truth: PathTruth, names: dict, tracker: Tracker, q, speed, time: float) -> np.ndarray:
    """Joint accelerations: differences of least-norm speeds along the motion, made to fit."""
    ends = [tracker.speeds(q + shift * speed, time + shift) for shift in (-_STEP / 2, _STEP / 2)]
    guess = (ends[1] - ends[0]) / _STEP
    now = truth.path.at(time)
    found = []
    contacts = truth.contacts(split(names, q), split(names, speed), now)
    X = np.hstack([c.X for c in contacts])
    need = X.T @ np.concatenate([now.acceleration, now.alpha])[truth.balance]
    need = np.split(need, len(contacts))
    for c, part, mine in zip(contacts, tracker.parts, need, strict=True):
        wanted = mine + c.swing - c.lag
        found.append(guess[part] + np.linalg.pinv(c.J) @ (wanted - c.J @ guess[part]))
    return scipy.linalg.block_diag(*[each[None] for each in found]).sum(axis=0)
