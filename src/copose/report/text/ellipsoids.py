"""Ellipsoids of postures as rows of a table, and those of the companions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.table import Table

from copose.problem import SPACES
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.text.columns import aligned, table
from copose.report.words import ANGULAR_AXES, LINEAR_AXES, semi_axis_units, six, three
from copose.results import EllipsoidRecord, Posture, Solution


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


def companion_tables(solution: Solution, posture: Posture, *, columns: int = 6) -> Iterator[Table]:
    """Tables with a row for each ellipsoid of velocities and of forces: its linear and angular
    semi-axes, and how far it reaches along every axis and every direction of the objective.
    """
    records, axes = posture.companions or {}, solution.problem.axes
    limited = solution.problem.torque_scaling == "limits"
    torque = "at the torque limits" if limited else "per N·m of torque"
    velocities = {name: record for name, record in records.items() if "velocity" in name}
    internal = {name: record for name, record in records.items() if name == "internal force"}
    forces = {n: record for n, record in records.items() if n not in velocities | internal}
    for title, units, alike in (
        ("velocities per unit joint speed", ("m/s", "rad/s"), velocities),
        (f"forces {torque}", ("N", "N·m"), forces),
    ):
        yield from _semi_axes(title, units, alike, axes)
    external = velocities | forces
    longest = max((len(record.along or ()) for record in external.values()), default=0)
    words = [*axes, *(f"direction {k + 1}" for k in range(longest - len(axes)))][:longest]
    for i in range(0, longest, columns):
        shown = slice(i, i + columns)
        rows = [
            (name, *map(three, (record.along or (None,) * longest)[shown]))
            for name, record in external.items()
        ]
        yield table(("the same along", *words[shown]), rows)
    unit = "N and N·m" if SPACES[solution.problem.space].rigid else "N"
    squeezed = []
    for name, record in internal.items():
        radii = [three(radius) for radius in record.radii or ()]
        if len(radii) > columns:
            radii[columns - 1 : -1] = ["…"]
        squeezed.append((name, "  ".join(radii) or "–"))
    if squeezed:
        yield table((f"forces between arms {torque}", f"semi-axes, {unit}"), squeezed)


def _semi_axes(
    title: str, units: tuple[str, str], records: Mapping[str, EllipsoidRecord], axes: Sequence[str]
) -> Iterator[Table]:
    """A table with a row for each ellipsoid; nothing where no posture has one."""
    titles, columns = [title], []
    for part, word, unit in zip(
        (linear_slice, angular_slice), ("linear", "angular"), units, strict=True
    ):
        slices = [part(record, axes) for record in records.values()]
        if any(slices):
            titles.append(f"{word} semi-axes, {unit}")
            columns.append(aligned(list(map(radii_words, slices)), "  "))
    if columns:
        yield table(titles, zip(records, *columns, strict=True))
