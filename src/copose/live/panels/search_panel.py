"""The panel's part for the search and its local optima."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from functools import partial
from html import escape
from typing import Any, Protocol

import viser

from copose.live.panels.controls import Controls, put_content, see
from copose.live.session.state import SearchAim
from copose.report.figures.files import proof_picture
from copose.report.words import six
from copose.results import Optimum, Solution


class SearchActs(Protocol):
    """Actions of this part; each returns at once."""

    def search(self, aim: SearchAim) -> None:
        """Search everything."""

    def choose(self, optimum: Optimum) -> None:
        """Go to a local optimum."""


class SearchPanel:
    """The controls of a search, and a button for each of the best optima."""

    def __init__(
        self, controls: Controls, seed: int, acts: SearchActs, *, buttons: int = 8
    ) -> None:
        """Build the controls, with as many buttons as local optima are listed at most."""
        self._controls, self._acts = controls, acts
        self._shown: Sequence[Optimum] = ()
        self._add_search(seed, buttons)

    def show(self, optima: Sequence[Optimum], solution: Solution) -> None:
        """List local optima, the best first, and draw the proof of a search's result."""
        self._shown = optima
        proof = None if solution.search is None else solution.search.proof
        drawn = "" if proof is None else f"<p>{escape(proof.statement)}</p>"
        if proof is not None and proof.map is not None:
            picture = base64.b64encode(proof_picture(solution)).decode()
            words = "the objective; a star marks the answer, red what was bounded last"
            drawn += (
                f'<img width="100%" alt="{words}" src="data:image/png;base64,{picture}">{words}'
            )
        put_content(self._proof, drawn)
        for k, button in enumerate(self._buttons):
            if k < len(optima):
                optimum = optima[k]
                button.label = f"{k + 1}: {six(optimum.objective)}, met ×{optimum.count}"
            see(button, k < len(optima))

    def _add_search(self, begin: int, buttons: int) -> None:
        """Add effort, seed and the button that searches."""
        gui = self._controls.gui
        effort: Any = gui.add_dropdown("effort", ("low", "normal", "high"), initial_value="normal")
        seed = gui.add_number("seed", begin, min=0, step=1)
        verify = gui.add_checkbox("verify", False, hint="again, another seed, twice the effort")
        prove = gui.add_checkbox("prove", False, hint="that nothing beats it by more than 1e-6")
        button = gui.add_button("Search", icon=viser.Icon.SEARCH)
        gui.add_markdown("Local optima; click one and the arms go there:")
        self._buttons = [gui.add_button("", visible=False) for _ in range(buttons)]
        self._proof = gui.add_html("")

        def search() -> None:
            epsilon = 1e-6 if prove.value else None
            self._acts.search(SearchAim(effort.value, int(seed.value), verify.value, epsilon))

        self._controls.clicked(button, search)
        for k, optimum in enumerate(self._buttons):
            self._controls.clicked(optimum, partial(self._choose, k))

    def _choose(self, k: int) -> None:
        """Go to a listed optimum."""
        if k < len(self._shown):
            self._acts.choose(self._shown[k])
