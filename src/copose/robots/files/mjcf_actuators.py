"""The actuators of a MuJoCo model, joint by joint, and the tendons that pull joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copose.poses import Array
from copose.robots.files.mjcf_model import MjcfModel, named


@dataclass(frozen=True, eq=False)
class JointActuators:
    """The actuators of a joint taken together."""

    effort: float | None  # the largest torque or force, N·m or N; None where there is no limit
    armature: float  # reflected inertia of their rotors, kg·m² or kg
    # Remarks on what is read otherwise than the model says, each with a value.
    doubts: dict[str, str]


@dataclass(frozen=True, eq=False)
class MjcfActuators:
    """The actuators of a compiled model."""

    source: MjcfModel

    @cached_property
    def _actuators(self) -> list[tuple[int, int, int]]:
        """Number, first control and first output of each actuator."""
        m = self.source.model
        count = getattr(m, "nactuator", m.nu)
        # Before MuJoCo 4 each has one of both.
        controls = getattr(m, "actuator_ctrladr", range(count))
        outputs = getattr(m, "actuator_outadr", range(count))
        return [(a, int(controls[a]), int(outputs[a])) for a in range(count)]

    def _transmission(self, a: int) -> str:
        """The kind of what actuator a acts on, such as JOINT."""
        return named(self.source.mujoco.mjtTrn, self.source.model.actuator_trntype[a])

    def drive(self, j: int) -> JointActuators:
        """The actuators of joint j: of several the weakest counts."""
        m = self.source.model
        own = [
            (a, control, float(m.actuator_gear[output, 0]))
            for a, control, output in self._actuators
            if self._transmission(a) in ("JOINT", "JOINTINPARENT") and m.actuator_trnid[a, 0] == j
        ]
        rotors = getattr(m, "actuator_armature", np.zeros(len(self._actuators)))
        armature = float(sum(gear**2 * rotors[a] for a, _, gear in own))
        ranges = [span for a, control, gear in own for span in self._ranges(a, control, gear)]
        if m.jnt_actfrclimited[j]:
            ranges.append(m.jnt_actfrcrange[j])
        doubts: dict[str, str] = {}
        if not ranges:
            return JointActuators(None, armature, doubts)
        sides = np.array([np.maximum([-low, high], 0.0) for low, high in map(sorted, ranges)])
        below, above = sides.min(axis=0).tolist()
        if below != above:
            text = "the smaller side of torque ranges that are not symmetric counts"
            doubts[text] = f"{-below + 0.0:g} … {above:g}"
        if len(own) > 1:
            doubts["the weakest of several actuators counts"] = f"{len(own)}"
        return JointActuators(min(below, above), armature, doubts)

    def _ranges(self, a: int, control: int, gear: float) -> Iterator[Array]:
        """Ranges of the torque of an actuator."""
        m, mj = self.source.model, self.source.mujoco
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
        """Names of the tendons by which actuators pull joints, by number of the joint."""
        m = self.source.model
        names = self.source.names("TENDON", m.ntendon)
        tendons: dict[int, str] = {}
        for a, *_ in self._actuators:
            if self._transmission(a) == "TENDON":
                t = int(m.actuator_trnid[a, 0])
                for j in self._along(t):
                    tendons.setdefault(j, names[t] or f"tendon{t + 1}")
        return tendons

    def _along(self, t: int) -> list[int]:
        """The joints that change the length of a tendon."""
        m = self.source.model
        wraps: dict[str, list[int]] = {}
        for w in range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t]):
            kind = named(self.source.mujoco.mjtWrap, m.wrap_type[w])
            wraps.setdefault(kind, []).append(int(m.wrap_objid[w]))
        joints = wraps.get("JOINT", [])
        bodies = [m.site_bodyid[site] for site in wraps.get("SITE", [])]
        bodies += [m.geom_bodyid[g] for kind in ("SPHERE", "CYLINDER") for g in wraps.get(kind, [])]
        above = [self._above(body) for body in bodies]
        for j in range(m.njnt):
            if 0 < sum(m.jnt_bodyid[j] in bodies_above for bodies_above in above) < len(above):
                joints.append(j)
        return joints

    def _above(self, body: int) -> Sequence[int]:
        """A body and those that it hangs on."""
        above = [int(body)]
        while above[-1] > 0:
            above.append(int(self.source.model.body_parentid[above[-1]]))
        return above
