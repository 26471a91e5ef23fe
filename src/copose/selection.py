"""Greedy selection of items that keep a distance from each other, and groups of like items."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from copose.poses import Indices, Mask

Item = TypeVar("Item")


def far_apart(
    items: Iterable[Item], far: Callable[[Item, Sequence[Item]], bool], most: int | None = None
) -> list[Item]:
    """The items, in order, that are far from all items taken before.

    Args:
        items: in order of preference.
        far: whether an item is far from those taken before it.
        most: items, at most.
    """
    taken: list[Item] = []
    for item in items:
        if len(taken) == most:
            break
        if far(item, taken):
            taken.append(item)
    return taken


def far_apart_rows(
    free: Mask, near: Mask | Callable[[int, Mask], Mask | Indices], most: int | None = None
) -> list[int]:
    """Numbers of rows, in order, that are near to no row taken before.

    The same as `far_apart`, where the rows near to one are known, or computed, all at once.

    Args:
        free: which rows may be taken, (count,).
        near: which rows are near to which, (count, count), or what tells those near to a row, as a
            mask or by number; its second argument tells which are still free, and others need not
            be among them.
        most: rows, at most.
    """
    free, taken = free.copy(), list[int]()
    for row in range(len(free)):
        if len(taken) == most:
            break
        if free[row]:
            taken.append(row)
            free[near(row, free) if callable(near) else near[row]] = False
    return taken


def groups(items: Iterable[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Items in groups, in order: each joins the first group whose first item is like it."""
    grouped: list[list[Item]] = []
    for item in items:
        group = next((group for group in grouped if alike(group[0], item)), None)
        if group is None:
            grouped.append([item])
        else:
            group.append(item)
    return grouped
