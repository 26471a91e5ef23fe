"""The points of a study as they are ranked and drawn, and the bodies that its keys move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from copose.errors import InputError
from copose.poses import Array, Indices, Mask
from copose.problem import is_planar, overridden
from copose.studies.table import StudyTable

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


PARTS = ("all", "solved", "best tenth", "none")
"""Parts of the points that the scene shows."""


@dataclass(frozen=True, eq=False)
class StudyPoints:
    """The points of a study that are done."""

    table: StudyTable  # of the study
    value: str  # name of the number that ranks and colours them

    @cached_property
    def bodies(self) -> MovedBodies:
        """The bodies that the study moves."""
        study = self.table.study
        return MovedBodies(study.problems.tables, study.file.keys)

    @cached_property
    def _columns(self) -> dict[str, list[Any]]:
        """The values of all keys, one for each point."""
        rows = [self.table.values(point) for point in range(len(self.table))]
        return {key: [row[key] for row in rows] for key in self.table.study.file.keys}

    @cached_property
    def statuses(self) -> np.ndarray:
        """Status of each point, (count,) of strings."""
        return np.array(self.table.statuses)

    @cached_property
    def values(self) -> Array:
        """The number of each point, nan where there is none or it is not solved, (count,)."""
        return np.where(self.statuses == "solved", self.table.numbers[self.value], np.nan)

    @cached_property
    def ranking(self) -> Indices:
        """The solved points that have a number, the best first."""
        return np.array(self.table.best(len(self.table), self.value), dtype=np.intp)

    @cached_property
    def _ranks(self) -> Indices:
        ranks = np.full(len(self.table), -1, dtype=np.intp)
        ranks[self.ranking] = np.arange(len(self.ranking))
        return ranks

    def rank(self, point: int) -> int | None:
        """The place of a point in the ranking, from 0; None where it has none."""
        rank = int(self._ranks[point])
        return None if rank < 0 else rank

    def by(self, value: str) -> StudyPoints:
        """The same points ranked by another number."""
        other = StudyPoints(self.table, value)
        for name in ("bodies", "_columns", "statuses"):
            if name in vars(self):
                vars(other)[name] = vars(self)[name]
        return other

    @cached_property
    def best_first(self) -> Indices:
        """The points that are done: solved ones, the best first, then infeasible ones, then those
        that failed.
        """
        done = np.flatnonzero(self.statuses != "missing")
        statuses = self.statuses[done]
        kinds = np.select([statuses == "solved", statuses == "infeasible"], [0, 1], 2)
        values = np.nan_to_num(self.values[done], nan=-np.inf)
        return done[np.lexsort((-values, kinds))]

    def seen(self, numbers: Indices, part: str) -> Mask:
        """Mask of the points that belong to a part of all, see `PARTS`, (count,)."""
        if part in ("all", "none"):
            return np.full(len(numbers), part == "all")
        least = len(self.ranking) if part == "solved" else -(-len(self.ranking) // 10)
        ranks = self._ranks[numbers]
        return (ranks >= 0) & (ranks < least)

    def marks(self, body: str) -> Marks:
        """The points as marks in the scene, where a body stands."""
        order = self.best_first
        positions = self.bodies.positions(body, self._columns)[order]
        places, first, place = np.unique(positions, axis=0, return_index=True, return_inverse=True)
        return Marks(places, order[first], order, place.ravel())


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks in the scene, one at each place."""

    places: Array  # m, (count, 3)
    points: Indices  # the best point at each place, (count,)
    ranked: Indices  # all points, the best first, (points,)
    place: Indices  # of each of them by number, (points,)

    @cached_property
    def distance(self) -> float:
        """The distance of most marks from the nearest other one, m; 0 of one mark."""
        if len(self.places) < 2:
            return 0.0
        from scipy.spatial import KDTree

        distances, _ = KDTree(self.places).query(self.places, k=2)
        return float(np.median(np.asarray(distances)[:, 1]))

    def at(self, point: int) -> Array | None:
        """The place of a point, m, (3,); None where it has none."""
        for place in self.place[self.ranked == point].tolist():
            return np.array(self.places[place])
        return None

    def here(self, point: int) -> list[int]:
        """The points at the place of one, the best first."""
        places = self.place[self.ranked == point]
        points: list[int] = (
            self.ranked[self.place == places[0]].tolist() if len(places) else [point]
        )
        return points

    def hit(
        self, origin: Array, direction: Array, radius: float, seen: Mask, spread: float = 0.01
    ) -> int | None:
        """The best point of the mark that a ray hits; None where it hits none.

        Of marks that it meets the nearest is hit; where it meets none, the one that it passes at
        the smallest angle.

        Args:
            origin: of the ray, m, (3,).
            direction: a unit vector, (3,).
            radius: of marks, m.
            seen: marks that can be hit, (count,).
            spread: rad, by which a hand may miss.
        """
        ahead = (self.places - origin) @ direction
        away = np.linalg.norm(self.places - origin - ahead[:, None] * direction, axis=1)
        ahead[~seen] = -np.inf
        met = (ahead > 0) & (away <= radius)
        if met.any():
            return int(self.points[np.where(met, ahead, np.inf).argmin()])
        angle = np.where(ahead > 0, away / np.maximum(ahead, 1e-9), np.inf)
        near = int(angle.argmin())
        return int(self.points[near]) if angle[near] <= spread else None
