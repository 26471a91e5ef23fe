"""A MuJoCo model as a tree of links and joints: bodies and sites are its links."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from copose.errors import InputError
from copose.poses import Array, Pose, frozen_array
from copose.problem import read_bytes
from copose.robots.arm import Body, motion
from copose.robots.tree import MOVABLE, Mimic, Tree, TreeJoint, TreeLink, box_corners

_MOST_BYTES = 50_000_000
_MOST_JOINTS = 2_000
# Lengths, masses and inertias beyond this are no robot's, and their products overflow.
_LARGEST = 1e9
_FIRST_TAG = re.compile(rb"<([A-Za-z_][\w.:-]*)")
_ASIDE = re.compile(rb"<!--.*?-->", re.DOTALL)
# Geoms that MuJoCo's boxes round them tell enough of.
_SOLID = ("BOX", "SPHERE", "CAPSULE", "CYLINDER", "ELLIPSOID")
# The function that MuJoCo warns by is the process's; without one it writes a file.
_ONE_AT_A_TIME = threading.Lock()


def first_tag(file: Path) -> str:
    """The name of a file's first element, empty where there is none.

    Raises:
        InputError: the file cannot be read.
    """
    found = _FIRST_TAG.search(_ASIDE.sub(b"", read_bytes(file, _MOST_BYTES)))
    return found[1].decode() if found else ""


def read_mjcf(file: Path) -> Tree:
    """Read a MuJoCo model, as MuJoCo compiles it.

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
    with _ONE_AT_A_TIME, _quiet(mujoco):
        try:
            model = mujoco.MjModel.from_xml_path(str(file))
        except (ValueError, mujoco.FatalError) as error:
            text = " ".join(str(error).split()).removeprefix("Error: ")
            raise InputError(f"{file.name} is no model that MuJoCo can read: {text}") from None
    if model.njnt > _MOST_JOINTS:
        raise InputError(f"{file.name} has {model.njnt} joints; at most {_MOST_JOINTS} are read")
    return _Reader(file, mujoco, model).tree()


def named(enumeration: Any, value: int) -> str:
    """The name of a value of one of MuJoCo's enumerations, such as HINGE."""
    return str(enumeration(int(value)).name).rpartition("_")[2]


@contextlib.contextmanager
def _quiet(mujoco: Any) -> Iterator[None]:
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@dataclass(frozen=True, eq=False)
class _Drive:
    """What the actuators of a joint can do.

    Attributes:
        effort: the largest torque or force, N·m or N; None where there is no limit.
        armature: what they add to that of the joint.
        doubts: as a joint has them, without its name.
    """

    effort: float | None
    armature: float
    doubts: dict[str, str]


@dataclass(frozen=True, eq=False)
class _Reader:
    """Reads a compiled model."""

    file: Path
    mujoco: Any
    model: Any

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
            model=m,
            bodies={name: body for body, name in enumerate(self.links)},
            keyframe=keyframe,
            qpos=qpos,
            addresses={
                name: int(m.jnt_qposadr[j])
                for j, name in enumerate(self.joints)
                if self._kind(j) in MOVABLE
            },
        )

    @cached_property
    def sites(self) -> list[str]:
        """Names, empty of those that have none."""
        return self._names("SITE", self.model.nsite)

    @cached_property
    def links(self) -> list[str]:
        """Names of the links that bodies are. A site has its name before a body."""
        names = self._names("BODY", self.model.nbody)
        taken = {name for name in (*names, *self.sites) if name}
        found: list[str] = []
        for body, name in enumerate(names):
            own = f"{name} (body)" if name in self.sites else name
            found.append(own if own and own not in found else _other(f"body{body}", taken))
            taken.add(found[-1])
        return found

    @cached_property
    def taken(self) -> set[str]:
        """Names of all links."""
        return {*self.links, *self.sites}

    @cached_property
    def joints(self) -> list[str]:
        """Names of all joints."""
        names = self._names("JOINT", self.model.njnt)
        taken = set(names)
        return [name or _other(f"joint{j + 1}", taken) for j, name in enumerate(names)]

    def _names(self, kind: str, count: int) -> list[str]:
        of = getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}")
        return [self.mujoco.mj_id2name(self.model, of, i) or "" for i in range(count)]

    def _check_numbers(self) -> None:
        m = self.model
        of_body = m.body_pos, m.body_quat, m.body_mass, m.body_inertia, m.body_ipos, m.body_iquat
        of_joint = m.jnt_pos, m.jnt_axis, np.nan_to_num(m.jnt_range, posinf=0, neginf=0)
        groups = (
            ("body", self.links, of_body),
            ("joint", self.joints, of_joint),
            ("site", self.sites, (m.site_pos, m.site_quat)),
        )
        for what, names, arrays in groups:
            for array in arrays:
                # Comparing is false of what is no number.
                sound = np.abs(array) <= _LARGEST
                for i in np.argwhere(~sound)[:1, 0]:
                    raise InputError(
                        f"{self.file.name}: {what} {names[i]!r} has a number that is not finite, "
                        f"or beyond ±{_LARGEST:g}"
                    )

    def _steps(self, body: int) -> Iterator[TreeJoint]:
        """The joints between a body's parent and it, first to last, and what their anchors are off.

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
            kind = self._kind(j)
            # The pose of a free body is its position itself, the origin of others the body's.
            anchor = np.zeros(3) if kind not in MOVABLE else m.jnt_pos[j]
            last = j == joints[-1] and not anchor.any()
            child = name if last else _other(f"{name}:{self.joints[j]}", self.taken)
            yield self._joint(j, kind, parent, child, place @ Pose.from_rpy(anchor))
            parent, place = child, Pose.from_rpy(-anchor)
        if joints and parent != name:
            yield self._fixed(parent, name, place)

    def _fixed(self, parent: str, child: str, place: Pose) -> TreeJoint:
        return _tied(_other(f"{child} on {parent}", {*self.joints}), parent, child, place)

    def _kind(self, j: int) -> str:
        kind = named(self.mujoco.mjtJoint, self.model.jnt_type[j])
        hinge = "revolute" if self.model.jnt_limited[j] else "continuous"
        kinds = {"HINGE": hinge, "SLIDE": "prismatic"}
        return kinds.get(kind, f"a {kind.lower()} joint")

    def _joint(self, j: int, kind: str, parent: str, child: str, place: Pose) -> TreeJoint:
        m, name = self.model, self.joints[j]
        if kind not in MOVABLE:
            return _tied(name, parent, child, place, kind)
        axis = frozen_array(m.jnt_axis[j])
        dof = m.jnt_dofadr[j]
        lower, upper = m.jnt_range[j].tolist() if m.jnt_limited[j] else (-np.inf, np.inf)
        drive = self._drive(j)
        mimic = self.mimics.get(j)
        doubts = {what: f"{name} ({text})" for what, text in drive.doubts.items()}
        if m.jnt_stiffness[j] or m.dof_damping[dof] or m.dof_frictionloss[dof]:
            doubts["springs, damping and friction are left out"] = name
        tendon = self.pulled.get(j)
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
            origin=place @ motion(kind, axis, -float(m.qpos0[m.jnt_qposadr[j]])),
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
        m = self.model
        found = None
        if m.body_mass[body] > 0:
            place = Pose.from_quaternion(m.body_ipos[body], m.body_iquat[body])
            inertia = frozen_array(np.diag(m.body_inertia[body]))
            found = Body(float(m.body_mass[body]), frozen_array(np.zeros(3)), inertia).placed(place)
        geoms = np.flatnonzero(m.geom_bodyid == body)
        known = [g for g in geoms if named(self.mujoco.mjtGeom, m.geom_type[g]) in _SOLID]
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
        return TreeLink(found, "", frozen_array(np.vstack(corners)), bounded, doubts=doubts)

    def _bound(self, body: int) -> Iterator[str]:
        """The body's name where a constraint closes a loop by it."""
        m = self.model
        for e in self._equalities("CONNECT", "WELD"):
            ends = m.eq_obj1id[e], m.eq_obj2id[e]
            if named(self.mujoco.mjtObj, m.eq_objtype[e]) == "SITE":
                ends = tuple(m.site_bodyid[end] for end in ends)
            if body in ends:
                yield self.links[body]

    def _equalities(self, *kinds: str) -> list[int]:
        m, of = self.model, self.mujoco.mjtEq
        return [e for e in range(m.neq) if m.eq_active0[e] and named(of, m.eq_type[e]) in kinds]

    @cached_property
    def mimics(self) -> dict[int, Mimic]:
        """By joint what an equality constraint has it follow: y − y₀ = Σ aₖ (x − x₀)ᵏ."""
        m = self.model
        found: dict[int, Mimic] = {}
        for e in self._equalities("JOINT"):
            j, leader = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            rest = float(m.qpos0[m.jnt_qposadr[j]])
            follows = np.polynomial.Polynomial(m.eq_data[e, : 5 if leader >= 0 else 1])
            if leader >= 0:
                offset = float(m.qpos0[m.jnt_qposadr[leader]])
                follows = follows(np.polynomial.Polynomial([-offset, 1.0]))
            name = self.joints[leader] if leader >= 0 else ""
            coefficients = (follows + rest).trim().coef
            found.setdefault(j, Mimic(name, tuple(float(a) for a in coefficients)))
        return found

    @cached_property
    def _actuators(self) -> list[tuple[int, int, int]]:
        """Number, first control and first output of the actuators."""
        m = self.model
        count = getattr(m, "nactuator", m.nu)
        # Before MuJoCo 4 each has one of both.
        controls = getattr(m, "actuator_ctrladr", range(count))
        outputs = getattr(m, "actuator_outadr", range(count))
        return [(a, int(controls[a]), int(outputs[a])) for a in range(count)]

    def _transmission(self, a: int) -> str:
        return named(self.mujoco.mjtTrn, self.model.actuator_trntype[a])

    def _drive(self, j: int) -> _Drive:
        """What the actuators of joint j can do: of several, what the weakest can."""
        m = self.model
        mine = [
            (a, control, float(m.actuator_gear[output, 0]))
            for a, control, output in self._actuators
            if self._transmission(a) in ("JOINT", "JOINTINPARENT") and m.actuator_trnid[a, 0] == j
        ]
        rotors = getattr(m, "actuator_armature", np.zeros(len(self._actuators)))
        armature = float(sum(gear**2 * rotors[a] for a, _, gear in mine))
        ranges = [span for a, control, gear in mine for span in self._ranges(a, control, gear)]
        if m.jnt_actfrclimited[j]:
            ranges.append(m.jnt_actfrcrange[j])
        doubts: dict[str, str] = {}
        if not ranges:
            return _Drive(None, armature, doubts)
        sides = np.array([np.maximum([-low, high], 0.0) for low, high in map(sorted, ranges)])
        below, above = sides.min(axis=0).tolist()
        if below != above:
            text = "the smaller side of torque ranges that are not symmetric counts"
            doubts[text] = f"{-below + 0.0:g} … {above:g}"
        if len(mine) > 1:
            doubts["the weakest of several actuators counts"] = f"{len(mine)}"
        return _Drive(min(below, above), armature, doubts)

    def _ranges(self, a: int, control: int, gear: float) -> Iterator[Array]:
        """Ranges of the torque of an actuator."""
        m, mj = self.model, self.mujoco
        if m.actuator_forcelimited[a]:
            yield gear * m.actuator_forcerange[a]
        gain, bias = named(mj.mjtGain, m.actuator_gaintype[a]), m.actuator_biastype[a]
        if gain != "FIXED" or named(mj.mjtBias, bias) != "NONE":
            return
        factor = gear * m.actuator_gainprm[a, 0]
        through = named(mj.mjtDyn, m.actuator_dyntype[a]) in ("NONE", "FILTER", "FILTEREXACT")
        if m.actuator_ctrllimited[control] and through:
            yield factor * m.actuator_ctrlrange[control]
        if m.actuator_actlimited[a]:
            yield factor * m.actuator_actrange[a]

    @cached_property
    def pulled(self) -> dict[int, str]:
        """By joint the tendon that an actuator pulls it by."""
        m = self.model
        names = self._names("TENDON", m.ntendon)
        found: dict[int, str] = {}
        for a, *_ in self._actuators:
            if self._transmission(a) == "TENDON":
                t = int(m.actuator_trnid[a, 0])
                for j in self._along(t):
                    found.setdefault(j, names[t] or f"tendon{t + 1}")
        return found

    def _along(self, t: int) -> list[int]:
        """The joints that change the length of a tendon."""
        m = self.model
        wraps: dict[str, list[int]] = {}
        for w in range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t]):
            kind = named(self.mujoco.mjtWrap, m.wrap_type[w])
            wraps.setdefault(kind, []).append(int(m.wrap_objid[w]))
        joints = wraps.get("JOINT", [])
        bodies = [m.site_bodyid[site] for site in wraps.get("SITE", [])]
        bodies += [m.geom_bodyid[g] for kind in ("SPHERE", "CYLINDER") for g in wraps.get(kind, [])]
        above = [self._above(body) for body in bodies]
        for j in range(m.njnt):
            if 0 < sum(m.jnt_bodyid[j] in some for some in above) < len(above):
                joints.append(j)
        return joints

    def _above(self, body: int) -> Sequence[int]:
        """A body and those that it hangs on."""
        found = [int(body)]
        while found[-1] > 0:
            found.append(int(self.model.body_parentid[found[-1]]))
        return found

    def _home(self) -> tuple[str, Array]:
        """The keyframe ``home``, or the first, and all positions in it."""
        m = self.model
        if not m.nkey:
            return "", frozen_array(m.qpos0)
        names = self._names("KEY", m.nkey)
        k = names.index("home") if "home" in names else 0
        return names[k] or "1", frozen_array(m.key_qpos[k])


def _frame() -> TreeLink:
    """A link that is but a frame."""
    return TreeLink(None, "", frozen_array(np.zeros((0, 3))), False)


def _tied(name: str, parent: str, child: str, place: Pose, kind: str = "fixed") -> TreeJoint:
    """A joint without a degree of freedom, or with more than one."""
    return TreeJoint(
        name, kind, parent, child, place, frozen_array([1.0, 0.0, 0.0]), 0.0, 0.0, None, None, None,
        {},
    )  # fmt: skip


def _other(name: str, taken: set[str]) -> str:
    """A name that is not taken."""
    while name in taken:
        name += "'"
    return name
