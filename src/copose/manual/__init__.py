"""The manual, one Markdown file a topic."""

from pathlib import Path

from copose.errors import InputError, nearest

_FOLDER = Path(__file__).parent
_ORDER = (
    "getting-started",
    "robots",
    "measures",
    "torques",
    "cells",
    "collision",
    "paths",
    "live",
    "commands",
    "problem-files",
    "python",
    "theory",
    "search",
    "paper",
    "benchmarks",
    "code",
    "troubleshooting",
    "faq",
)


def topics() -> dict[str, str]:
    """The titles of all topics, by their names, in the order in which to read them."""
    return {
        topic: _text(topic).partition("\n")[0].removeprefix("# ").partition(": ")[2]
        for topic in _ORDER
    }


def page(topic: str) -> str:
    """The page of a topic, Markdown.

    Raises:
        InputError: there is none.
    """
    if topic not in _ORDER:
        raise InputError(
            f"no topic is called {topic!r}{nearest(topic, _ORDER)} (`copose manual` lists them)",
            key="TOPIC",
        )
    return _text(topic)


def _text(topic: str) -> str:
    return (_FOLDER / f"{topic}.md").read_text(encoding="utf-8")
