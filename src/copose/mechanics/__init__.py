"""Arms and object as CasADi expressions: poses, J, M, W, closure."""

from copose.mechanics.held_object import HeldObject, object_parameters
from copose.mechanics.system import ArmMechanics, Coupling, Goal, System

__all__ = ["ArmMechanics", "Coupling", "Goal", "HeldObject", "System", "object_parameters"]
