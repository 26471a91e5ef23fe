"""Bodies that the keys of a study move, and where they stand at each of its points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from copose.errors import InputError
from copose.poses import Array
from copose.problem import is_planar, overridden

Tables: TypeAlias = Mapping[str, Any]


class MovedBodies:
    """The object and the bases of arms of which one of several keys changes the position.

    Attributes:
        names: ``object`` and ``base of ARM``, the object first.
    """

    def __init__(self, tables: Tables, keys: Sequence[str]) -> None:
        """The bodies that keys, dotted paths, move; the tables are the problem's without their
        values.
        """
        self._tables = _places_of(tables)
        self._paths: dict[str, tuple[Any, ...]] = {"object": ("object", "position")}
        for i, arm in enumerate(tables["arms"]):
            self._paths[f"base of {arm['name']}"] = ("arms", i, "base", "position")
        parts = {name: {key: self._part(key, name) for key in keys} for name in self._paths}
        self._parts = {
            name: {key: part for key, part in of_keys.items() if part is not None}
            for name, of_keys in parts.items()
        }
        self.names = tuple(name for name, of_keys in self._parts.items() if of_keys)

    def positions(self, name: str, columns: Mapping[str, Sequence[Any]]) -> Array:
        """Positions of a body in the world, m, (count, 3), by columns of values of keys."""
        count = len(next(iter(columns.values())))
        positions = np.tile(self._position(name, {}), (count, 1))
        # Of two keys the later one counts, as in a problem.
        for key, part in self._parts[name].items():
            column = columns[key]
            if isinstance(part, int):
                positions[:, part] = column
                continue
            known = {repr(value): value for value in column}
            places = {said: self._position(name, {key: value}) for said, value in known.items()}
            positions[:] = [places[repr(value)] for value in column]
        return positions

    def _position(self, name: str, values: Tables) -> Array:
        """A body's position where keys have these values, m, (3,)."""
        position = _at(overridden(self._tables, values), self._paths[name])
        return np.array([*position, 0.0][:3], dtype=float)

    def _part(self, key: str, name: str) -> int | str | None:
        """The component of a body's position that a key is of, ``whole`` of all of it or more; None
        of a key that does not move the body.
        """
        mark = _Mark()
        try:
            position = _at(overridden(self._tables, {key: mark}), self._paths[name])
        except InputError:
            # It is of what has no place.
            return None
        if isinstance(position, list):
            return position.index(mark) if mark in position else None
        return "whole"


class _Mark:
    """A value like no other."""


def _places_of(tables: Tables) -> dict[str, Any]:
    """The part of a problem's tables that says where bodies stand; at the origin unless it does."""
    origin = {"position": [0.0] * (2 if is_planar(tables) else 3)}
    return {
        "task": tables.get("task", {}),
        "object": origin | {"position": tables["object"]["position"]},
        "arms": [
            {"name": arm["name"], "base": origin | dict(arm.get("base", {}))}
            for arm in tables["arms"]
        ],
    }


def _at(node: Any, path: Sequence[Any]) -> Any:
    """The value at the end of a path of keys; the origin where there is none."""
    for step in path:
        if isinstance(node, Mapping):
            node = node.get(step, [0.0, 0.0, 0.0])
        elif isinstance(node, list) and isinstance(step, int):
            node = node[step]
    return node
