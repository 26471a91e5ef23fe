"""Colours as viser takes them."""

from __future__ import annotations


def rgb(color: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour such as ``#D55E00``, 0 to 255."""
    red, green, blue = bytes.fromhex(color.removeprefix("#"))
    return red, green, blue
