"""Ellipsoids of velocities and of forces, which stand beside that of accelerations, as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.table import Table

from copose.problem import SPACES
from copose.report.geometry.slices import angular_slice, linear_slice
from copose.report.numbers import three
from copose.report.text.columns import aligned, table
from copose.report.text.ellipsoids import radii_words
from copose.results import EllipsoidRecord, Posture, Solution


def companion_tables(solution: Solution, posture: Posture, *, columns: int = 6) -> Iterator[Table]:
    """Tables with a row for each ellipsoid of velocities and of forces: its linear and angular
    semi-axes, and how far it reaches along every axis and every direction of the objective.

    Args:
        solution: the result of the posture.
        posture: the posture.
        columns: numbers beside one another.
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
