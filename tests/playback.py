"""A motion played in MuJoCo: arms from numbers, hands welded to the object, torques fed forward.

The model is written from joints, placements and inertias alone, without meshes; nothing collides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from copose.problem import parse
from copose.robots import Arm, load_arms
from object_path import ObjectPath
from path_truth import hermite, stacked

STEP = 2.5e-4  # s
# Hands are welded as stiffly as the time step allows: a constraint's error vanishes critically
# damped with a time constant of two steps, and the constraint is all but hard.
SOLREF = (2 * STEP, 1.0)
SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
STIFFNESS, DAMPING = 100.0, 10.0  # N·m/rad and N·m·s/rad of the joints


@dataclass(frozen=True)
class Played:
    """How a motion went.

    Attributes:
        off: the object's centre from its path, m, at every step.
        turned: its rotation from that of the path, rad.
        correcting: the PD's torques, (steps, N).
        driving: all torques, (steps, N).
        opening: the largest error of a weld, m or rad.
    """

    off: np.ndarray
    turned: np.ndarray
    correcting: np.ndarray
    driving: np.ndarray
    opening: float

    @property
    def share(self) -> float:
        """The PD's rms over that of all torques."""
        return float(np.sqrt(np.mean(self.correcting**2) / np.mean(self.driving**2)))


def _numbers(values) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(values))


def _place(pose) -> str:
    return f'pos="{_numbers(pose.position)}" quat="{_numbers(pose.quaternion)}"'


def _inertial(mass: float, com, inertia) -> str:
    inertia = np.array(inertia)
    six = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return f'<inertial mass="{mass!r}" pos="{_numbers(com)}" fullinertia="{_numbers(six)}"/>'


def _arm(arm: Arm) -> str:
    opened = [f'<body name="{arm.name}" {_place(arm.base)}>']
    for joint in arm.joints:
        kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
        opened.append(
            f'<body name="{arm.name}/{joint.name}" {_place(joint.placement)}>'
            f"{_inertial(joint.body.mass, joint.body.com, joint.body.inertia)}"
            f'<joint name="{arm.name}/{joint.name}" type="{kind}" axis="{_numbers(joint.axis)}" '
            f'armature="{joint.armature!r}"/>'
        )
    opened.append(f'<site name="{arm.name}/tip" {_place(arm.tip)}/>')
    return "".join(opened) + "</body>" * (len(arm.joints) + 1)


def model_of(tables: dict) -> mujoco.MjModel:
    """The arms of a spatial problem and its object."""
    problem = parse(tables)
    arms = load_arms(problem)
    assert problem.space.name == "spatial", "grasps are rigid"
    gravity = tables.get("world", {}).get("gravity", [0.0, 0.0, -9.81])
    inertia = np.array(tables["object"]["inertia"], dtype=float)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    grasps = "".join(f'<site name="{arm.name}/grasp" {_place(arm.grasp)}/>' for arm in arms)
    welds = "".join(
        f'<weld site1="{arm.name}/tip" site2="{arm.name}/grasp" '
        f'solref="{_numbers(SOLREF)}" solimp="{_numbers(SOLIMP)}"/>'
        for arm in arms
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian" autolimits="false"/>'
        f'<option timestep="{STEP}" integrator="implicitfast" gravity="{_numbers(gravity)}" '
        f'tolerance="1e-12" iterations="100"><flag contact="disable"/></option>'
        f"<worldbody>{''.join(map(_arm, arms))}"
        f'<body name="object"><freejoint name="object"/>'
        f"{_inertial(tables['object']['mass'], [0, 0, 0], inertia)}{grasps}</body></worldbody>"
        f"<equality>{welds}</equality></mujoco>"
    )


def played(tables: dict, motion: dict) -> Played:
    """The motion from its first knot to its last."""
    model = model_of(tables)
    data = mujoco.MjData(model)
    path = ObjectPath(tables, motion["duration"])
    names = [f"{arm}/{joint}" for arm, joints in motion["joint_names"].items() for joint in joints]
    at = np.array([model.joint(name).qposadr[0] for name in names])
    dof = np.array([model.joint(name).dofadr[0] for name in names])
    here = model.joint("object").qposadr[0]
    time = np.array(motion["time"])
    q, v, torque = (stacked(motion, key) for key in ("joints", "velocity", "torque"))
    begin = path.at(0.0)
    data.qpos[at] = q[0]
    data.qpos[here : here + 3] = begin.position
    mujoco.mju_mat2Quat(data.qpos[here + 3 : here + 7], begin.rotation.ravel())
    off, turned, correcting, driving, opening = [], [], [], [], 0.0
    for _ in range(round(time[-1] / STEP)):
        t = data.time
        k = min(int(np.searchsorted(time, t, side="right")) - 1, len(time) - 2)
        span = time[k + 1] - time[k]
        x = (t - time[k]) / span
        wanted, speed = hermite(q[k], q[k + 1], v[k], v[k + 1], span, x)
        fed = (1 - x) * torque[k] + x * torque[k + 1]
        pull = STIFFNESS * (wanted - data.qpos[at]) + DAMPING * (speed - data.qvel[dof])
        data.qfrc_applied[dof] = fed + pull
        correcting.append(pull)
        driving.append(fed + pull)
        mujoco.mj_step(model, data)
        opening = max(opening, float(np.abs(data.efc_pos).max()))
        now = path.at(data.time)
        off.append(np.linalg.norm(data.qpos[here : here + 3] - now.position))
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, data.qpos[here + 3 : here + 7])
        apart = R.reshape(3, 3) @ now.rotation.T
        turned.append(math.acos(min(1.0, max(-1.0, (np.trace(apart) - 1) / 2))))
    return Played(np.array(off), np.array(turned), np.array(correcting), np.array(driving), opening)
