"""The values that stand in problem files, each with what it may be."""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

_LARGEST = 1e6
_SMALLEST = 1e-12
_NUMBER = {"type": "number"}
_NUMBERS = {"type": "array", "minItems": 3, "maxItems": 3, "items": _NUMBER}

Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=-_LARGEST, le=_LARGEST)]
Positive: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=_SMALLEST, le=_LARGEST)]
NotNegative: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=0, le=_LARGEST)]
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
    """What is wrong with a key that only the whole problem can judge."""
    return PydanticCustomError("copose_key", "{text}", {"key": key, "text": text})


def not_zero(value: float) -> float:
    """A number that counts."""
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
    """Three principal moments become the diagonal matrix they stand for."""
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
    float, BeforeValidator(_unsigned), Field(ge=_SMALLEST), WithJsonSchema(_NUMBER)
]
Range: TypeAlias = Annotated[tuple[Limit, Limit], AfterValidator(_range)]
Direction: TypeAlias = Annotated[tuple[Number, ...], AfterValidator(_direction)]
Quaternion: TypeAlias = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit)]
Inertia: TypeAlias = Annotated[
    Matrix3,
    BeforeValidator(_inertia_matrix),
    AfterValidator(_physical_inertia),
    WithJsonSchema(
        {"type": "array", "minItems": 3, "maxItems": 3, "items": {"anyOf": [_NUMBER, _NUMBERS]}}
    ),
]


class Spec(BaseModel):
    """The root of every table: frozen, no unknown keys, no silent conversion."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)
