"""Numbers as argument types of argparse, each refused with a line that says what is needed."""

from __future__ import annotations

import argparse
import math

from copose.errors import shown


def seed(text: str) -> int:
    """A seed, a whole number from 0 to 2⁶³ − 1."""
    if not text.isascii() or not text.isdigit() or int(text[:20]) >= 2**63:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no whole number from 0 to 2⁶³ − 1")
    return int(text)


def count(text: str) -> int:
    """A whole number from 1."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:9]) < 10**8:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no whole number from 1")
    return int(text)


def port(text: str) -> int:
    """A network port, a whole number from 0 to 65535."""
    largest = 65535
    number = int(text) if text.isascii() and text.isdigit() and len(text) < 6 else -1
    if not 0 <= number <= largest:
        raise argparse.ArgumentTypeError(f"{text!r} is no port, a whole number to {largest}")
    return number


def seconds(text: str) -> float:
    """A finite duration above zero, s."""
    try:
        duration = float(text)
    except ValueError:
        duration = math.nan
    if not 0 < duration < math.inf:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no finite number of seconds above 0")
    return duration


def positive(text: str) -> float:
    """A finite number above zero."""
    values = _numbers(text)
    if len(values) != 1 or values[0] <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)} is no number above zero")
    return values[0]


def edges(text: str) -> list[float]:
    """The three edges of a box, ``X,Y,Z``, each above zero."""
    values = _numbers(text)
    if len(values) != 3 or min(values) <= 0:
        raise argparse.ArgumentTypeError(f"{shown(text)}: three numbers above zero are needed")
    return values


def named_numbers(text: str) -> tuple[str, list[float]]:
    """An arm and its joint positions, ``ARM=Q1,Q2,…``."""
    name, equals, values = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{shown(text)}: ARM=Q1,Q2,… is needed")
    return name, _numbers(values)


def _numbers(text: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if not values or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{shown(text)}: numbers apart by commas are needed")
    return values
