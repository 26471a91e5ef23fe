"""The manual, one Markdown file a topic."""

from pathlib import Path

from copose.errors import InputError, nearest

_FOLDER = Path(__file__).parent


def topics() -> dict[str, str]:
    """The title of every topic, by its name."""
    return {
        file.stem: file.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        for file in sorted(_FOLDER.glob("*.md"))
    }


def page(topic: str) -> str:
    """A topic's page, Markdown.

    Raises:
        InputError: there is none.
    """
    known = topics()
    if topic not in known:
        raise InputError(
            f"no topic is called {topic!r}{nearest(topic, known)} (`copose manual` lists them)",
            key="TOPIC",
        )
    return (_FOLDER / f"{topic}.md").read_text(encoding="utf-8")
