"""The manual, one file in Markdown for each topic."""

from pathlib import Path
from typing import Literal, TypeAlias, get_args

from copose.errors import InputError, nearest

Topic: TypeAlias = Literal[
    "getting-started",
    "robots",
    "measures",
    "torques",
    "cells",
    "collision",
    "paths",
    "studies",
    "live",
    "commands",
    "problem-files",
    "python",
    "theory",
    "search",
    "proof",
    "paper",
    "benchmarks",
    "code",
    "troubleshooting",
    "faq",
]
"""Names of topics, in the order in which to read them."""


def topics() -> dict[str, str]:
    """The titles of all topics, by their names, in the order in which to read them."""
    return {
        topic: _text(topic).partition("\n")[0].removeprefix("# ").partition(": ")[2]
        for topic in get_args(Topic)
    }


def page(topic: str) -> str:
    """The page of a topic, Markdown.

    Raises:
        InputError: there is none.
    """
    known = get_args(Topic)
    if topic not in known:
        raise InputError(
            f"no topic is called {topic!r}{nearest(topic, known)} (`copose manual` lists them)",
            key="TOPIC",
        )
    return _text(topic)


def _text(topic: str) -> str:
    """The content of a topic's file."""
    return Path(__file__).with_name(f"{topic}.md").read_text(encoding="utf-8")
