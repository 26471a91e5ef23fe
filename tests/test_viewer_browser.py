"""Exported pages in a browser: they open from a file, ask for nothing, show what they are to."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

import copose
from browser import Chromium, View
from copose.results import Motion, Solution, read_result
from copose.viewer import page_html
from reference import PROBLEMS

SNAPSHOTS = Path(__file__).parent / "snapshots"
SMALL = (480, 360)


def opened(view: View, folder: Path, name: str, result: str, *nodes: str) -> Solution | Motion:
    """A result as a page, open in a browser."""
    found = read_result(SNAPSHOTS / f"{result}.json")
    file = folder / "a page.html"
    page = page_html(found, copose.load(PROBLEMS / f"{name}.toml"))
    file.write_text(page, encoding="utf-8")
    view.open(file.as_uri(), *nodes)
    assert view.page.title() == name
    return found


def colors(view: View) -> np.ndarray:
    """What the page looks like, (height, width, 3)."""
    picture = Image.open(io.BytesIO(view.page.screenshot()))
    return np.asarray(picture.convert("RGB"), dtype=float)


def test_a_posture_opens_from_a_file_and_shows_the_arms(chromium: Chromium, tmp_path: Path) -> None:
    with chromium.view(SMALL) as view:
        solution = opened(
            view, tmp_path, "two-panda-box", "spatial", "/arms/left/joint7/panda_hand",
            "/arms/right/root/panda_link0", "/object/shape", "/ellipsoid/linear",
            "/ellipsoid/angular", "/before/left/joint4/panda_link4",
        )  # fmt: skip
        for name, arm in solution.after.arms.items():
            for k in range(1, 8):
                pose = view.pose(f"/arms/{name}/joint{k}")
                assert np.allclose(pose[:3], arm.skeleton[k], atol=1e-5)
                sign = np.sign(pose[3:] @ arm.quaternions[k])
                assert np.allclose(sign * pose[3:], arm.quaternions[k], atol=1e-5)
        assert np.allclose(view.pose("/object")[:3], solution.after.object.position, atol=1e-6)
        # Links are seen in their arm's colour where they are.
        seen = colors(view)
        for name, channel in (("left", 2), ("right", 1)):
            tint = []
            for point in solution.after.arms[name].skeleton[1:-2]:
                x, y = np.rint(view.pixel(point)).astype(int)
                here = seen[y, x]
                tint.append(here[channel] > here[0] + 40 and here.argmax() == channel)
            assert np.mean(tint) > 0.5
        assert view.requests == [(tmp_path / "a page.html").as_uri()]
        assert not view.errors


def test_a_motion_plays(chromium: Chromium, tmp_path: Path) -> None:
    with chromium.view(SMALL) as view:
        motion = opened(view, tmp_path, "panda-carry-path", "path", "/object/shape", "/path")
        places = np.array([knot.object.position for knot in motion.knots])
        seen: set[int] = set()

        def moved() -> bool:
            at = view.pose("/object")
            if at is not None:
                gaps = np.linalg.norm(places - at[:3], axis=1)
                if gaps.min() < 1e-5:
                    seen.add(int(gaps.argmin()))
            return len(seen) > 2

        view.eventually(moved)
        assert not view.foreign and not view.errors
