"""Ellipsoids of several postures as rows of a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from copose.problem import SPACES
from copose.report.axes import ANGULAR_AXES, LINEAR_AXES, semi_axis_units
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.numbers import six, three
from copose.report.text.columns import aligned
from copose.results import Posture, Solution


def ellipsoid_rows(postures: Sequence[tuple[Solution, Posture]]) -> Iterator[tuple[str, ...]]:
    """Rows of volumes by both resolutions, of semi-axes and of centres, a cell for each posture.

    Args:
        postures: each with its result; what none has is left out.
    """
    for name in postures[0][1].log_volumes:
        volumes = [posture.log_volumes.get(name) for _, posture in postures]
        yield f"log-volume, {name}", *map(six, volumes)
    centres = []
    for k, (part, names) in enumerate(((linear_slice, LINEAR_AXES), (angular_slice, ANGULAR_AXES))):
        slices = [part(posture.ellipsoid, s.problem.axes) for s, posture in postures]
        unit = " | ".join(dict.fromkeys(semi_axis_units(s)[k] for s, _ in postures))
        if any(slices):
            yield f"semi-axes, {unit}", *aligned(list(map(radii_words, slices)), "  ")
        parts = [
            [x for x, axis in zip(p.ellipsoid.center, s.problem.axes, strict=True) if axis in names]
            if p.ellipsoid.center
            else []
            for s, p in postures
        ]
        if any(map(any, parts)):
            words = aligned([list(map(three, part)) or ["–"] for part in parts], "  ")
            centres.append((f"centre at zero torque, {('m/s²', 'rad/s²')[k]}", *words))
    yield from centres


def closure_row(space: str, postures: Sequence[Sequence[Posture]]) -> tuple[str, ...]:
    """A row of the largest closure errors, a cell for each group of postures."""
    errors = [max(max(p.closure_error.values()) for p in group) for group in postures]
    unit = "m, rad" if SPACES[space].rigid else "m"
    return f"closure error, {unit}", *(f"{error:.1e}" for error in errors)


def radii_words(part: Slice | None) -> list[str]:
    """Semi-axes, longest first; – where there is no slice."""
    return ["–"] if part is None else [three(radius) for radius in part.ellipsoid.radii]
