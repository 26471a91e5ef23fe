"""The HTML representation that notebooks ask of problems and results."""

from __future__ import annotations

from importlib import import_module


class Displayed:
    """Shown as a table and a picture where a cell of a notebook ends in it."""

    def _repr_html_(self) -> str:
        # Tables and pictures stand above what they are of: they are loaded when one is shown.
        shown: str = import_module("copose.notebook").html(self)
        return shown
