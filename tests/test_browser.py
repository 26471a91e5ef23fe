"""The browser of the tests sees viser's pages: a drag of a gizmo's arrow reaches Python."""

from __future__ import annotations

import numpy as np
import pytest

from browser import Chromium

viser = pytest.importorskip("viser")


@pytest.mark.long
def test_a_drag_of_an_arrow_reaches_python(chromium: Chromium) -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    heard: list[tuple[str, np.ndarray]] = []
    try:
        server.initial_camera.position = (0.0, -2.0, 0.0)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.scene.add_box("/box", dimensions=(0.2, 0.2, 0.2))
        gizmo = server.scene.add_transform_controls("/gizmo", scale=0.5)

        @gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            heard.append((event.phase, np.array(event.target.position)))

        with chromium.view() as view:
            view.open(f"http://127.0.0.1:{server.get_port()}", "/box", "/gizmo")
            view.drag(view.pixel([0.3, 0.0, 0.0]), view.pixel([0.6, 0.0, 0.0]))
            view.eventually(lambda: heard and heard[-1][0] == "end")
            phases = [phase for phase, _ in heard]
            shown = view.pose("/gizmo")
            assert not view.foreign
            assert len(view.requests) >= 2
            assert not view.errors
    finally:
        server.stop()
    assert phases[0] == "start"
    assert set(phases[1:-1]) == {"update"}
    # The point under the mouse follows it, whatever the frame rate.
    assert heard[-1][1] == pytest.approx([0.3, 0.0, 0.0], abs=0.02)
    assert shown is not None
    assert shown[:3] == pytest.approx(heard[-1][1], abs=1e-4)
