"""The house keeps its own rules: style, types, and the direction in which data flows."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from reference import PROBLEMS

ROOT = PROBLEMS.parent
TOOLS = Path(sys.executable).parent


@pytest.mark.parametrize(
    "command",
    ["ruff check .", "ruff format --check .", "mypy", "lint-imports"],
)
def test_house_rules(command: str) -> None:
    tool, *arguments = command.split()
    answer = subprocess.run(
        [TOOLS / tool, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
