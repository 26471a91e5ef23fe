"""Joint inertia and gravity torques of a chain, by composite rigid bodies.

Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 6.2; here all
quantities are about the origin of the arm's root frame. Written out because the library that
does it on CasADi expressions is not among Pinocchio's wheels.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from copose.mechanics.chain import Chain, constant
from copose.poses import Array


def mass_matrix(chain: Chain) -> ca.SX:
    """Joint inertia M(q) with armature on its diagonal, (n, n).

    M_ij = s_iᵀ I_j s_j for i ≤ j, with s the joint's motion [v; ω] at the root origin and I_j
    the inertia of all bodies from joint j outwards, about that origin.
    """
    n = chain.arm.n
    motions = [_motion(chain, i) for i in range(n)]
    M = ca.SX(n, n)
    mass, first, second = 0.0, ca.SX(3, 1), ca.SX(3, 3)
    for j in reversed(range(n)):
        body_mass, com, inertia = _body(chain, j)
        mass += body_mass
        first += body_mass * com
        second += inertia + body_mass * (ca.dot(com, com) * ca.SX.eye(3) - com @ com.T)
        v, w = motions[j]
        force = mass * v + ca.cross(w, first)
        moment = second @ w + ca.cross(first, v)
        for i in range(j + 1):
            v_i, w_i = motions[i]
            M[i, j] = M[j, i] = ca.dot(v_i, force) + ca.dot(w_i, moment)
        M[j, j] += chain.arm.joints[j].armature
    return M


def gravity_torques(chain: Chain, gravity: Array | ca.SX) -> ca.SX:
    """Joint torques g(q) that hold the arm against gravity, (n,).

    Args:
        chain: the arm's frames.
        gravity: acceleration of free fall in root axes, m/s², (3,).
    """
    n = chain.arm.n
    fall = gravity if isinstance(gravity, ca.SX) else constant(np.asarray(gravity))
    torques = []
    mass, first = 0.0, ca.SX(3, 1)
    for j in reversed(range(n)):
        body_mass, com, _ = _body(chain, j)
        mass += body_mass
        first += body_mass * com
        v, w = _motion(chain, j)
        torques.append(-ca.dot(v, mass * fall) - ca.dot(w, ca.cross(first, fall)))
    return ca.vertcat(*reversed(torques))


def inverse_dynamics(
    chain: Chain, accelerations: ca.SX, fall: ca.SX, wrench: ca.SX, rates: ca.SX | None = None
) -> tuple[ca.SX, ca.SX]:
    """Torques M q̈ + C q̇ + g + Jᵀh, (n,), and tip acceleration J q̈ + J̇ q̇, (6,).

    Without M and J: what is differentiated stays short. Velocities and accelerations of bodies,
    those of the point at the root origin, add up from the root outwards, forces and moments about
    it from the tip inwards.

    Args:
        chain: the arm's frames.
        accelerations: q̈, (n,).
        fall: acceleration of free fall in root axes, m/s², (3,).
        wrench: h, what the tip exerts, force over moment about its origin, root axes, (6,).
        rates: q̇, (n,); None at rest.
    """
    n = chain.arm.n
    linear, angular = -fall, ca.SX(3, 1)
    speed, turning = ca.SX(3, 1), ca.SX(3, 1)
    wrenches = []
    for j in range(n):
        v, w = _motion(chain, j)
        linear, angular = linear + v * accelerations[j], angular + w * accelerations[j]
        if rates is not None:
            # The joint's axis is carried along by the body before it.
            linear += (ca.cross(turning, v) + ca.cross(speed, w)) * rates[j]
            angular += ca.cross(turning, w) * rates[j]
            speed, turning = speed + v * rates[j], turning + w * rates[j]
        body, frame = chain.arm.joints[j].body, chain.frames[j]
        R = frame.rotation
        com = frame.position + R @ constant(body.com)
        force = body.mass * (linear + ca.cross(angular, com))
        moment = R @ (constant(body.inertia) @ (R.T @ angular))
        if rates is not None:
            force += body.mass * ca.cross(turning, speed + ca.cross(turning, com))
            moment += ca.cross(turning, R @ (constant(body.inertia) @ (R.T @ turning)))
        wrenches.append((force, moment + ca.cross(com, force)))
    tip = chain.tip.position
    reached = ca.vertcat(
        linear + fall + ca.cross(angular, tip) + ca.cross(turning, speed + ca.cross(turning, tip)),
        angular,
    )
    torques = []
    force, moment = wrench[:3], wrench[3:] + ca.cross(tip, wrench[:3])
    for j in reversed(range(n)):
        force, moment = force + wrenches[j][0], moment + wrenches[j][1]
        v, w = _motion(chain, j)
        own = chain.arm.joints[j].armature * accelerations[j]
        torques.append(ca.dot(v, force) + ca.dot(w, moment) + own)
    return ca.vertcat(*reversed(torques)), reached


def _motion(chain: Chain, i: int) -> tuple[ca.SX, ca.SX]:
    """Unit-speed motion of joint i: velocity of the point at the root origin, angular velocity."""
    if chain.arm.joints[i].kind == "prismatic":
        return chain.axes[i], ca.SX(3, 1)
    return ca.cross(chain.frames[i].position, chain.axes[i]), chain.axes[i]


def _body(chain: Chain, i: int) -> tuple[float, ca.SX, ca.SX]:
    """Mass, centre of mass and inertia about it of body i, in root axes."""
    body, frame = chain.arm.joints[i].body, chain.frames[i]
    com = frame.position + frame.rotation @ constant(body.com)
    inertia = frame.rotation @ constant(body.inertia) @ frame.rotation.T
    return body.mass, com, inertia
