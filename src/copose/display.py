"""The HTML representation that notebooks ask of problems and results."""

from __future__ import annotations

from importlib import import_module


class Displayed:
    """An object that a notebook shows as a table and a picture."""

    def _repr_html_(self) -> str:
        # Tables and pictures are in rooms above results: they are loaded when one is shown.
        shown: str = import_module("copose.notebook").html(self)
        return shown
