"""The shapes of a robot's links as its file gives them, and notes about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from copose.collision.shapes.solids import Part

LinkPair: TypeAlias = tuple[str, str]
# By link its choices of shapes, the best first.
Looks: TypeAlias = dict[str, tuple[tuple[Part, ...], ...]]


@dataclass(frozen=True, eq=False)
class Geometry:
    """The shapes of a robot's links."""

    parts: Mapping[str, tuple[Part, ...]]  # by link, placed in its frame; of some links none
    faults: dict[str, str]  # of each link whose shape cannot be read, the reason
    notes: list[str]  # what stands in for shapes, and what is left out
    # Of each package that was not found, where it was looked for; among the notes too.
    missing: tuple[str, ...] = ()
    # Mesh files that were read, by name in the robot's file, if they are no parts of that.
    files: Mapping[str, Path] = field(default_factory=dict)


def only_visual(file: Path) -> str:
    """A note that a robot's file has no collision geometry."""
    return f"{file.name} has no collision geometry; its visual geometry is tested"


def listed(links: Mapping[str, str], most: int = 5) -> str:
    """The first links with a remark on each, and the number of the others."""
    named = ", ".join(f"{name} ({text})" for name, text in [*links.items()][:most])
    return named + (f" and {len(links) - most} more" if len(links) > most else "")
