"""A MuJoCo model as a tree of links and joints: bodies and sites are its links."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from copose.errors import InputError
from copose.poses import Array, Pose, frozen_array
from copose.problem import read_bytes
from copose.robots.arm import Body, joint_motion
from copose.robots.files.mjcf_actuators import MjcfActuators
from copose.robots.files.mjcf_model import MjcfModel, named, unused
from copose.robots.files.tree import (
    MOVABLE,
    READING_LIMITS,
    Mimic,
    ReadingLimits,
    Tree,
    TreeJoint,
    TreeLink,
    box_corners,
)

# MuJoCo's function for warnings belongs to the whole process; without one it writes a file.
_LOCK = threading.Lock()


def first_tag(file: Path) -> str:
    """The name of a file's first element, empty where there is none.

    Raises:
        InputError: the file cannot be read.
    """
    text = re.sub(rb"<!--.*?-->", b"", read_bytes(file, READING_LIMITS.bytes), flags=re.DOTALL)
    tag = re.search(rb"<([A-Za-z_][\w.:-]*)", text)
    return tag[1].decode() if tag else ""


def read_mjcf(file: Path, limits: ReadingLimits = READING_LIMITS) -> Tree:
    """The tree of a MuJoCo model, as MuJoCo compiles it.

    Raises:
        InputError: no such file, MuJoCo is missing or cannot compile it, or numbers that no robot
            has.
    """
    tag = first_tag(file)
    if tag != "mujoco":
        hint = "; name a URDF by urdf" if tag == "robot" else ""
        raise InputError(f"{file.name} is no MuJoCo model: its root is <{tag}>, not <mujoco>{hint}")
    try:
        import mujoco
    except ImportError:
        raise InputError(
            f"{file.name} is a MuJoCo model, and the package mujoco is not installed; "
            "pip install 'copose[mjcf]'"
        ) from None
    with _LOCK, _quiet(mujoco):
        try:
            model = mujoco.MjModel.from_xml_path(str(file))
        except (ValueError, mujoco.FatalError) as error:
            text = " ".join(str(error).split()).removeprefix("Error: ")
            raise InputError(f"{file.name} is no model that MuJoCo can read: {text}") from None
    if model.njnt > limits.joints:
        raise InputError(f"{file.name} has {model.njnt} joints; at most {limits.joints} are read")
    return _Reader(file, mujoco, model, limits).tree()


@contextlib.contextmanager
def _quiet(mujoco: Any) -> Iterator[None]:
    """A time in which MuJoCo's warnings are lost."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@dataclass(frozen=True, eq=False)
class _Reader(MjcfModel):
    """A reader of a compiled model as a tree."""

    limits: ReadingLimits  # of what is read

    @cached_property
    def actuators(self) -> MjcfActuators:
        """The actuators of the model."""
        return MjcfActuators(self)

    def tree(self) -> Tree:
        """Its links and joints, parents first."""
        m = self.model
        self._check_numbers()
        links: dict[str, TreeLink] = {}
        order: list[TreeJoint] = []
        for body in range(m.nbody):
            name = self.links[body]
            if body > 0:
                steps = [*self._steps(body)]
                order += steps
                links |= {step.child: _frame() for step in steps}
            links[name] = self._link(body)
        for site, name in enumerate(self.sites):
            if name:
                parent = self.links[m.site_bodyid[site]]
                place = Pose.from_quaternion(m.site_pos[site], m.site_quat[site])
                order.append(self._fixed(parent, name, place))
                links[name] = _frame()
        keyframe, qpos = self._home()
        return Tree(
            file=self.file,
            name=m.names[: m.names.index(b"\0")].decode(errors="replace"),
            links=links,
            joints={joint.child: joint for joint in order},
            root=self.links[0],
            order=tuple(order),
            foreign=(),
            format="mjcf",
            model=m,
            bodies={name: body for body, name in enumerate(self.links)},
            keyframe=keyframe,
            qpos=qpos,
            addresses={
                name: int(m.jnt_qposadr[j])
                for j, name in enumerate(self.joints)
                if self.kind(j) in MOVABLE
            },
        )

    def _check_numbers(self) -> None:
        """Refuse numbers that no robot has, naming the body, the joint or the site."""
        m, largest = self.model, self.limits.number
        of_body = m.body_pos, m.body_quat, m.body_mass, m.body_inertia, m.body_ipos, m.body_iquat
        of_joint = m.jnt_pos, m.jnt_axis, np.nan_to_num(m.jnt_range, posinf=0, neginf=0)
        groups = (
            ("body", self.links, of_body),
            ("joint", self.joints, of_joint),
            ("site", self.sites, (m.site_pos, m.site_quat)),
        )
        for what, names, arrays in groups:
            for array in arrays:
                # NaN is not sound, as all comparisons with it are false.
                sound = np.abs(array) <= largest
                for i in np.argwhere(~sound)[:1, 0]:
                    raise InputError(
                        f"{self.file.name}: {what} {names[i]!r} has a number that is not finite, "
                        f"or beyond ±{largest:g}"
                    )

    def _steps(self, body: int) -> Iterator[TreeJoint]:
        """The joints between a body's parent and the body, and fixed ones to and from anchors.

        Joints of one body move it one after the other, each about its own anchor. Positions
        count from that at which the model is written.
        """
        m = self.model
        first = int(m.body_jntadr[body])
        joints = range(first, first + int(m.body_jntnum[body]))
        parent, name = self.links[m.body_parentid[body]], self.links[body]
        place = Pose.from_quaternion(m.body_pos[body], m.body_quat[body])
        if not joints:
            yield self._fixed(parent, name, place)
        for j in joints:
            kind = self.kind(j)
            # The pose of a free body is its position itself, the origin of others the body's.
            anchor = np.zeros(3) if kind not in MOVABLE else m.jnt_pos[j]
            last = j == joints[-1] and not anchor.any()
            child = name if last else unused(f"{name}:{self.joints[j]}", self.taken)
            yield self._joint(j, kind, parent, child, place @ Pose.from_rpy(anchor))
            parent, place = child, Pose.from_rpy(-anchor)
        if joints and parent != name:
            yield self._fixed(parent, name, place)

    def _fixed(self, parent: str, child: str, place: Pose) -> TreeJoint:
        return _tied(unused(f"{child} on {parent}", {*self.joints}), parent, child, place)

    def _joint(self, j: int, kind: str, parent: str, child: str, place: Pose) -> TreeJoint:
        m, name = self.model, self.joints[j]
        if kind not in MOVABLE:
            return _tied(name, parent, child, place, kind)
        axis = frozen_array(m.jnt_axis[j])
        dof = m.jnt_dofadr[j]
        lower, upper = m.jnt_range[j].tolist() if m.jnt_limited[j] else (-np.inf, np.inf)
        drive = self.actuators.drive(j)
        mimic = self.mimics.get(j)
        doubts = {what: f"{name} ({text})" for what, text in drive.doubts.items()}
        if m.jnt_stiffness[j] or m.dof_damping[dof] or m.dof_frictionloss[dof]:
            doubts["springs, damping and friction are left out"] = name
        tendon = self.actuators.pulled.get(j)
        faults = {}
        if tendon is not None:
            faults["drive"] = (
                f"joint {name!r} is driven by the tendon {tendon!r}, which gives it no torque of "
                "its own; lock it, or choose another tip"
            )
        return TreeJoint(
            name=name,
            kind=kind,
            parent=parent,
            child=child,
            origin=place @ joint_motion(kind, axis, -float(m.qpos0[m.jnt_qposadr[j]])),
            axis=axis,
            lower=lower,
            upper=upper,
            effort=drive.effort,
            velocity=None,
            mimic=mimic,
            faults=faults,
            armature=float(m.dof_armature[dof]) + drive.armature,
            doubts=doubts,
        )

    def _link(self, body: int) -> TreeLink:
        m, body_of_link = self.model, None
        if m.body_mass[body] > 0:
            place = Pose.from_quaternion(m.body_ipos[body], m.body_iquat[body])
            inertia = frozen_array(np.diag(m.body_inertia[body]))
            at_center = Body(float(m.body_mass[body]), frozen_array(np.zeros(3)), inertia)
            body_of_link = at_center.placed(place)
        geoms = np.flatnonzero(m.geom_bodyid == body)
        # Geoms that are told well enough by MuJoCo's boxes round them.
        solid = ("BOX", "SPHERE", "CAPSULE", "CYLINDER", "ELLIPSOID")
        known = [g for g in geoms if named(self.mujoco.mjtGeom, m.geom_type[g]) in solid]
        corners = [np.zeros((0, 3))]
        for g in known:
            place = Pose.from_quaternion(m.geom_pos[g], m.geom_quat[g])
            center, half = m.geom_aabb[g, :3], m.geom_aabb[g, 3:]
            corners.append((box_corners(half) + center) @ place.rotation.T + place.position)
        bounded = 0 < len(geoms) == len(known)
        doubts = {}
        if m.body_gravcomp[body]:
            doubts["gravity compensation is left out"] = self.links[body]
        for other in self._bound(body):
            doubts["equality constraints between bodies are left out"] = other
        return TreeLink(body_of_link, "", frozen_array(np.vstack(corners)), bounded, doubts=doubts)

    def _bound(self, body: int) -> Iterator[str]:
        """The body's name where a constraint closes a loop by it."""
        m = self.model
        for e in self.equalities("CONNECT", "WELD"):
            ends = m.eq_obj1id[e], m.eq_obj2id[e]
            if named(self.mujoco.mjtObj, m.eq_objtype[e]) == "SITE":
                ends = tuple(m.site_bodyid[end] for end in ends)
            if body in ends:
                yield self.links[body]

    @cached_property
    def mimics(self) -> dict[int, Mimic]:
        """Joints that follow another by an equality constraint, y − y₀ = Σ aₖ (x − x₀)ᵏ."""
        m = self.model
        mimics: dict[int, Mimic] = {}
        for e in self.equalities("JOINT"):
            j, leader = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            rest = float(m.qpos0[m.jnt_qposadr[j]])
            follows = np.polynomial.Polynomial(m.eq_data[e, : 5 if leader >= 0 else 1])
            if leader >= 0:
                offset = float(m.qpos0[m.jnt_qposadr[leader]])
                follows = follows(np.polynomial.Polynomial([-offset, 1.0]))
            name = self.joints[leader] if leader >= 0 else ""
            coefficients = (follows + rest).trim().coef
            mimics.setdefault(j, Mimic(name, tuple(float(a) for a in coefficients)))
        return mimics

    def _home(self) -> tuple[str, Array]:
        """The keyframe ``home``, or the first, and all positions in it."""
        m = self.model
        if not m.nkey:
            return "", frozen_array(m.qpos0)
        names = self.names("KEY", m.nkey)
        k = names.index("home") if "home" in names else 0
        return names[k] or "1", frozen_array(m.key_qpos[k])


def _frame() -> TreeLink:
    """A link that is only a frame."""
    return TreeLink(None, "", frozen_array(np.zeros((0, 3))), False)


def _tied(name: str, parent: str, child: str, place: Pose, kind: str = "fixed") -> TreeJoint:
    """A joint without a degree of freedom, or with more than one."""
    return TreeJoint(
        name, kind, parent, child, place, frozen_array([1.0, 0.0, 0.0]), 0.0, 0.0, None, None, None,
        {},
    )  # fmt: skip
