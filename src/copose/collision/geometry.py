"""The shapes of links as the reader of a robot's file finds them, and words about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from copose.collision.solids import Part

# Links that a note names one by one.
_NAMED = 5


@dataclass(frozen=True, eq=False)
class Geometry:
    """The shapes of a robot's links.

    Attributes:
        parts: by link, placed in its frame; of some links none.
        faults: of the links whose shape cannot be read, why.
        notes: what stands in for shapes, and what is left out.
        missing: on packages that were not found, where was looked; among the notes too.
    """

    parts: Mapping[str, tuple[Part, ...]]
    faults: dict[str, str]
    notes: list[str]
    missing: tuple[str, ...] = ()


def only_visual(file: Path) -> str:
    """That a robot's file has no collision geometry."""
    return f"{file.name} has no collision geometry; its visual geometry is tested"


def listed(links: Mapping[str, str]) -> str:
    """Links and what is said of each, as many as a note names."""
    named = ", ".join(f"{name} ({text})" for name, text in [*links.items()][:_NAMED])
    return named + (f" and {len(links) - _NAMED} more" if len(links) > _NAMED else "")
