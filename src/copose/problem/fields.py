"""Types of the values in problem files, and the root of their tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Positive: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=1e-12, le=1e6)]
NotNegative: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e6)]
Pair: TypeAlias = tuple[Number, Number]
Triple: TypeAlias = tuple[Number, Number, Number]
Matrix3: TypeAlias = tuple[Triple, Triple, Triple]
Text: TypeAlias = Annotated[str, Field(max_length=10_000)]


def _name(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value.encode()) > 100:
        raise PydanticCustomError("copose", "must be a visible name of at most 100 bytes")
    return value


def _folder_name(value: str) -> str:
    if value.strip(". ") == "" or "/" in value or "\\" in value:
        raise PydanticCustomError(
            "copose", "must be a name without '/' or '\\': it names the output folder"
        )
    return _name(value)


def _limit(value: float) -> float:
    if math.isnan(value):
        raise PydanticCustomError("copose", "must be a number, or ±inf for none")
    return value


def _unsigned(value: Any) -> Any:
    """No torque limit is infinite, whatever its sign."""
    return math.inf if value == -math.inf else value


def whole(value: Any) -> Any:
    """An integer, and not a number or truth value that equals one."""
    if type(value) is not int:
        raise PydanticCustomError("copose", "must be a whole number")
    return value


def _range(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] >= pair[1]:
        raise PydanticCustomError("copose", "crossed limits: lower must be below upper")
    return pair


def fault(key: str, text: str) -> PydanticCustomError:
    """A fault of a key that only the whole problem shows."""
    return PydanticCustomError("copose_key", "{text}", {"key": key, "text": text})


def not_zero(value: float) -> float:
    """A number, which must not be 0."""
    if value == 0:
        raise PydanticCustomError("copose", "must not be zero")
    return value


def _direction(value: tuple[float, ...]) -> tuple[float, ...]:
    if not math.hypot(*value) > 1e-9:
        raise PydanticCustomError("copose", "must not be zero")
    return value


def _unit(value: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*value)
    if abs(norm - 1) > 1e-3:
        raise PydanticCustomError(
            "copose", "has norm {norm}; a rotation [w, x, y, z] has 1", {"norm": f"{norm:.6g}"}
        )
    return tuple(x / norm for x in value)


def _inertia_matrix(value: object) -> object:
    """A 3×3 matrix, diagonal where three principal moments are given."""
    if not isinstance(value, tuple) or len(value) != 3:
        raise PydanticCustomError("copose", "must be 3 diagonal entries or a 3×3 matrix")
    if all(isinstance(entry, tuple) for entry in value):
        return value
    return tuple(tuple(entry if i == j else 0.0 for j in range(3)) for i, entry in enumerate(value))


def _physical_inertia(inertia: Matrix3) -> Matrix3:
    matrix = np.array(inertia)
    size = float(np.abs(matrix).max())
    if not np.allclose(matrix, matrix.T, rtol=0, atol=1e-9 * size):
        raise PydanticCustomError("copose", "must be symmetric")
    moments = np.linalg.eigvalsh(matrix)
    if moments[0] < max(1e-9 * size, 1e-15):
        raise PydanticCustomError("copose", "must be positive definite")
    if moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
        raise PydanticCustomError(
            "copose",
            "violates the triangle inequality: no principal moment may exceed the sum of the "
            "other two",
        )
    return inertia


Interval: TypeAlias = Annotated[tuple[Number, Number], AfterValidator(_range)]
Name: TypeAlias = Annotated[str, AfterValidator(_name)]
FolderName: TypeAlias = Annotated[str, AfterValidator(_folder_name)]
Limit: TypeAlias = Annotated[float, AfterValidator(_limit)]
Torque: TypeAlias = Annotated[
    float, BeforeValidator(_unsigned), Field(ge=1e-12), WithJsonSchema({"type": "number"})
]
Range: TypeAlias = Annotated[tuple[Limit, Limit], AfterValidator(_range)]
Direction: TypeAlias = Annotated[tuple[Number, ...], AfterValidator(_direction)]
Quaternion: TypeAlias = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit)]
Inertia: TypeAlias = Annotated[
    Matrix3,
    BeforeValidator(_inertia_matrix),
    AfterValidator(_physical_inertia),
    WithJsonSchema(
        {
            "type": "array",
            "minItems": 3,
            "maxItems": 3,
            "items": {
                "anyOf": [
                    {"type": "number"},
                    {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}},
                ]
            },
        }
    ),
]


class Spec(BaseModel):
    """The root of every table: frozen, no unknown keys, no silent conversion."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)


def as_tuples(node: Any) -> Any:
    """Arrays as tuples: a frozen problem holds nothing that can be changed; scalars as Python's."""
    if isinstance(node, Mapping):
        return {key: as_tuples(value) for key, value in node.items()}
    if isinstance(node, (list, tuple)):
        return tuple(as_tuples(value) for value in node)
    if isinstance(node, np.ndarray):
        return as_tuples(node.tolist())
    return node.item() if isinstance(node, np.generic) else node
