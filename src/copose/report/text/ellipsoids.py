"""What ellipsoids of several postures are, as rows of a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from copose.problem import SPACES
from copose.report import style
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.text.columns import aligned
from copose.results import Posture, Solution


def ellipsoid_rows(postures: Sequence[tuple[Solution, Posture]]) -> Iterator[tuple[str, ...]]:
    """Volumes by both resolutions, semi-axes and centres, a cell for each posture; what there is.

    Args:
        postures: with the result that each is of.
    """
    for name in postures[0][1].log_volumes:
        volumes = [posture.log_volumes.get(name) for _, posture in postures]
        yield f"log-volume, {name}", *map(style.six, volumes)
    centres = []
    for k, (part, names) in enumerate(
        ((linear_slice, style.LINEAR_AXES), (angular_slice, style.ANGULAR_AXES))
    ):
        found = [part(posture.ellipsoid, s.problem.axes) for s, posture in postures]
        unit = " | ".join(dict.fromkeys(style.units(s)[k] for s, _ in postures))
        if any(found):
            yield f"semi-axes, {unit}", *aligned(list(map(radii_words, found)), "  ")
        parts = [
            [x for x, axis in zip(p.ellipsoid.center, s.problem.axes, strict=True) if axis in names]
            if p.ellipsoid.center
            else []
            for s, p in postures
        ]
        if any(map(any, parts)):
            words = aligned([list(map(style.three, part)) or ["–"] for part in parts], "  ")
            centres.append((f"centre at zero torque, {('m/s²', 'rad/s²')[k]}", *words))
    yield from centres


def closure_row(space: str, postures: Sequence[Sequence[Posture]]) -> tuple[str, ...]:
    """The largest closure error of each of some groups of postures."""
    errors = [max(max(p.closure_error.values()) for p in some) for some in postures]
    unit = "m, rad" if SPACES[space].rigid else "m"
    return f"closure error, {unit}", *(f"{error:.1e}" for error in errors)


def radii_words(part: Slice | None) -> list[str]:
    """Semi-axes, longest first; – where there is no slice."""
    return ["–"] if part is None else [style.three(radius) for radius in part.ellipsoid.radii]
