"""Names, units and labels of what varies in a study and of what is recorded."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

from copose.report.words import OBJECTIVE_WORDS, acceleration_unit, short
from copose.studies.points.points import Axis, Points
from copose.studies.study import Study

# Of numbers in a problem and in a result, by the last word of their paths that is listed here.
UNITS = {
    "position": "m", "size": "m", "length": "m", "radius": "m", "com": "m", "clearance": "m",
    "distance": "m", "freedom": "m", "skeleton": "m", "tolerance": "m", "closure_error": "m or rad",
    "rpy": "rad", "angle": "rad", "roll": "rad", "pitch": "rad", "yaw": "rad", "locked": "rad or m",
    "joint_margin": "rad", "start": "rad or m", "joints": "rad or m", "position_limits": "rad or m",
    "mass": "kg", "payload": "kg", "inertia": "kg·m²", "armature": "kg·m²",
    "torque_limits": "N·m", "torque": "N·m", "gravity": "m/s²", "residual_radius": "m/s²",
    "duration": "s", "build_s": "s", "search_s": "s", "smoothness": "s²/rad²",
}  # fmt: skip
_COMPONENTS = {
    "position": ("x", "y", "z"), "rpy": ("roll", "pitch", "yaw"),
    "quaternion": ("w", "x", "y", "z"),
}  # fmt: skip


@dataclass(frozen=True)
class KeyAxis:
    """A key, or several that vary together, as pictures and tables name it."""

    number: int  # among the axes of the points
    name: str  # the key, or what several have in common and where they differ
    unit: str  # of its numbers; empty where there is none
    labels: tuple[str, ...] | None  # of the rows of what is no number; None of numbers

    @property
    def title(self) -> str:
        """Name and unit."""
        return titled(self.name, self.unit)

    def told(self, along: float) -> str:
        """A place along the axis: name, value and unit."""
        if self.labels is not None:
            return f"{self.name.partition(':')[0]} ({self.value(along)})"
        return f"{self.name} {self.value(along)} {self.unit}".rstrip()

    def value(self, along: float) -> str:
        """The value at a place along the axis, without its unit."""
        return f"{along:.4g}" if self.labels is None else self.labels[int(along)]


def named_axes(points: Points) -> tuple[KeyAxis, ...]:
    """The axes of some points."""
    axes = enumerate(points.axes)
    return tuple(KeyAxis(i, _name_of(a), _unit_of(a), _labels_of(a)) for i, a in axes)


def titled(name: str, unit: str) -> str:
    """A name with its unit, where it has one."""
    return f"{name}, {unit}" if unit else name


def value_words(study: Study, name: str) -> tuple[str, str]:
    """Name and unit of a number of a study's results; the unit is empty where there is none."""
    if name == "objective" and not study.file.comparable:
        return "objective (kinds differ)", ""
    problem = study.problems.at(study.points.values(0))
    axes = [problem.space.coordinates[i] for i in problem.axes]
    accelerations = acceleration_unit(axes)
    per_torque = "" if problem.ellipsoid.torque_scaling == "limits" else " per N·m"
    if "radii" in name.split("."):
        return name, f"{accelerations}{per_torque}"
    if name != "objective":
        return name, unit_of(name)
    kind = problem.objective.kind
    units = {
        "worst-direction": f"{accelerations}{per_torque}",
        "acceleration": accelerations,
        "all-round": accelerations,
        "payload": "kg",
    }
    words = OBJECTIVE_WORDS[kind].value if kind in OBJECTIVE_WORDS else kind
    if study.file.command == "path" and problem.path is not None:
        words = f"{problem.path.aggregate} {words}"
    return words, units.get(kind, "")


def unit_of(path: str) -> str:
    """The unit of the number at a dotted path; empty where it is not known or there is none."""
    return next((UNITS[part] for part in reversed(path.split(".")) if part in UNITS), "")


def _unit_of(axis: Axis) -> str:
    return unit_of(axis.keys[0]) if axis.rows is None or axis.numbers is not None else ""


def _name_of(axis: Axis) -> str:
    """The key; of several its values are those of the first, where numbers tell the rows apart."""
    if len(axis.keys) > 1 and axis.numbers is not None:
        return f"{axis.keys[0]} (and {len(axis.keys) - 1} more)"
    return _shared(axis.keys)


def _shared(keys: Sequence[str]) -> str:
    """Keys as one name: ``arms.left.base: position, rpy``."""
    if len(keys) == 1:
        return keys[0]
    parts = [key.split(".") for key in keys]
    count = len(_alike(parts))
    ends = ", ".join(".".join(part[count:]) for part in parts)
    return f"{'.'.join(parts[0][:count])}: {ends}" if count else ends


def _labels_of(axis: Axis) -> tuple[str, ...] | None:
    if axis.rows is None or axis.numbers is not None:
        return None
    return row_labels(axis.keys, axis.rows)


def row_labels(keys: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> tuple[str, ...]:
    """Labels of rows of values: of each the parts in which not all are equal."""
    leaves = [dict(_leaves(dict(zip(keys, row, strict=True)), ())) for row in rows]
    paths = dict.fromkeys(path for row in leaves for path in row)
    differing = [path for path in paths if len({row.get(path) for row in leaves}) > 1]
    shown = {path: _trimmed([row.get(path, "–") for row in leaves]) for path in differing}
    several = len(differing) > 1 and not all(path[-1] in keys for path in differing)
    labels = [", ".join(_named(path, shown[path][i], several) for path in differing)
              for i in range(len(rows))]  # fmt: skip
    once = [f" ({labels[:i].count(label) + 1})" * (labels.count(label) > 1)
            for i, label in enumerate(labels)]  # fmt: skip
    return tuple(map(str.__add__, labels, once))


def _leaves(node: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Texts and numbers in tables and lists, with the way to each."""
    if isinstance(node, Mapping):
        inner = [(str(key), value) for key, value in node.items()]
    elif isinstance(node, (tuple, list)):
        inner = [(str(i), value) for i, value in enumerate(node)]
    else:
        yield path, f"{node:.4g}" if isinstance(node, float) and math.isfinite(node) else str(node)
        return
    for part, value in inner:
        yield from _leaves(value, (*path, part))


def _component(path: tuple[str, ...]) -> str:
    """The name of a leaf: its last word, of a vector the component."""
    if len(path) < 2 or not path[-1].isdigit():
        return path[-1].rpartition(".")[2]
    vector = path[-2].rpartition(".")[2]
    names, i = _COMPONENTS.get(vector, ()), int(path[-1])
    return names[i] if i < len(names) else f"{vector}.{i}"


def _named(path: tuple[str, ...], text: str, several: bool) -> str:
    """A leaf as a part of a label, with its name where the label has several."""
    return f"{_component(path)}\N{NO-BREAK SPACE}{text}" if several else text


def in_lines(label: str, letters: int, most: int = 4) -> str:
    """A label in a few short lines."""
    lines = textwrap.wrap(label, letters) or [""]
    kept = lines[:most]
    if len(lines) > most:
        kept[-1] = short(f"{kept[-1]} …", letters)
    return "\n".join(kept)


def _trimmed(texts: Sequence[str]) -> list[str]:
    """Texts without the folders that they begin with and the ending that they have in common."""
    begin = "".join(_alike(texts))
    begin = begin[: begin.rfind("/") + 1]
    ending = "".join(_alike([text[::-1] for text in texts]))[::-1]
    ending = ending[ending.rfind(".") :] if "/" in "".join(texts) and "." in ending else ""
    return [text.removeprefix(begin).removesuffix(ending) or text for text in texts]


def _alike(rows: Sequence[Sequence[str]]) -> list[str]:
    """What all begin with."""
    columns = zip(*rows, strict=False)
    return [column[0] for column in takewhile(lambda column: len({*column}) == 1, columns)]
