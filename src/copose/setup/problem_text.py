"""Problem files as text, with a comment above every line that was guessed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from copose.poses import Pose


def number(value: float, digits: int = 12) -> float:
    """A number without the last digits, and without a sign on zero."""
    return round(float(value), digits) + 0.0


def plain_line(text: str) -> str:
    """Text without line ends and other unprintable letters, which names of robots may hold."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def placement(pose: Pose) -> dict[str, list[float]]:
    """A pose as a problem file has it; ``rpy`` left out where it is zero."""
    rpy = [number(angle, 15) for angle in pose.plain_rpy]
    rpy = [0.0 if abs(angle) < 1e-12 else angle for angle in rpy]
    place = {"position": [number(x) for x in pose.position]}
    return place | ({"rpy": rpy} if any(rpy) else {})


def toml(value: object) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, Mapping):
        pairs = (f"{_key(key)} = {toml(item)}" for key, item in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, str):
        # TOML's strings are JSON's, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(toml, value)) + "]"
    assert isinstance(value, int | float)
    return repr(value)


def _key(key: str) -> str:
    """A key as TOML, in quotation marks where it needs them."""
    plain = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if plain else toml(key)


@dataclass
class ProblemText:
    """A problem file that grows line by line."""

    lines: list[str] = field(default_factory=list)  # so far
    guesses: list[str] = field(default_factory=list)  # what was guessed, in words, in order
    _arm: str = ""

    def remark(self, *lines: str) -> None:
        """Add comment lines."""
        self.lines += [f"# {plain_line(line)}" for line in lines]

    def table(self, header: str, arm: str = "") -> None:
        """Begin a table; of an arm with its name."""
        self.lines += ["", header]
        self._arm = f"{arm}: " if arm else ""

    def put(self, key: str, value: object, guess: str = "", change: str = "") -> None:
        """Add a key, with a comment on how it was guessed, if it was, and what to change."""
        if guess:
            short = len(toml(value)) <= 60
            named = f"{key} = {toml(value)}" if short else key
            self.guesses.append(f"{self._arm}{named}: {guess}")
            self.remark("guessed: " + "; ".join(filter(None, (guess, change))))
        self.lines.append(f"{key} = {toml(value)}")

    @property
    def text(self) -> str:
        """The file's content."""
        return "\n".join(self.lines) + "\n"
