"""The live page in the gallery: pictures of what a browser shows of it.

    python benchmarks/live_gallery.py [NAME …]

Opens pages in a headless Chromium and writes `problems/pictures/live-NAME.png`, by default all. A
picture carries in its text chunks a hash of the problem that it is of, as those of the gallery do.
"""

from __future__ import annotations

import argparse
import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gallery
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import copose
from copose.batch.run import run_points
from copose.live.page import Page
from copose.live.scene.gizmos import Gizmo
from copose.poses import Pose
from copose.studies.study import Study, StudyFolder
from copose.studies.table import StudyTable

sys.path.append(str(gallery.ROOT / "tests"))

import browser

# Size of the browser's window, pixels.
SIZE = (1200, 750)
# What viser says about slow drawing without a graphics card.
_NOTICE = ".mantine-Notifications-root {display: none}"


def moved(*by: float) -> Callable[[Page], object]:
    """The object dragged by so much, m."""

    def act(page: Page) -> None:
        place = page.state.problem.object.pose
        for phase, share in (("start", 0.0), ("update", 0.5), ("update", 1.0), ("end", 1.0)):
            at = [x + share * d for x, d in zip(place.position, by, strict=True)]
            page.drag(Gizmo("object"), Pose.make(at, place.rotation, place.quaternion), phase)
            page.settle()

    return act


# What is done on a page before its picture is taken.
ACTS = {"beyond-reach": moved(0.0, 0.9, 0.0)}
# The tab of the panel, where it is not the first.
TABS = {"by-hand": "By hand", "panda-carry-path": "Path"}


def opened(name: str) -> copose.Problem | StudyTable:
    """What a page is opened with: a problem, or the table of a study that is run first."""
    file = gallery.file_of(name)
    if not name.startswith("studies/"):
        return copose.load(file)
    with tempfile.TemporaryDirectory() as place:
        folder = StudyFolder(Path(place))
        run_points(Study.read(file), folder)
        return StudyTable.of(folder.study(), folder)


def place_of(name: str) -> Path:
    """The file of a picture."""
    return gallery.PROBLEMS / f"pictures/live-{name}.png"


def picture(name: str, chromium: browser.Chromium) -> bytes:
    """What a browser shows of a page, in few colours, with what it is of in its text chunks."""
    problem = gallery.LIVE[name][0]
    page = Page(opened(problem), host="127.0.0.1", port=0)
    try:
        with chromium.view(SIZE) as view:
            view.open(page.address, "/object", "/drag/object")
            view.page.add_style_tag(content=_NOTICE)
            if name in ACTS:
                ACTS[name](page)
            page.settle()
            if name in TABS:
                click(view.page, TABS[name])
            # Texts and meshes come one after another.
            view.page.wait_for_timeout(3000)
            view.draw()
            content = view.page.screenshot(timeout=1000 * browser.PATIENCE)
    finally:
        page.stop()
    told = PngInfo()
    told.add_text("problem", gallery.digest(problem))
    with Image.open(io.BytesIO(content)) as large:
        whole = large.convert("RGB")
    for colours in (256, 128, 64):
        few = whole.quantize(
            colours, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE
        )
        sink = io.BytesIO()
        few.save(sink, "png", optimize=True, pnginfo=told)
        if sink.tell() < gallery.LIVE_BYTES:
            return sink.getvalue()
    raise ValueError(f"the picture is larger than {gallery.LIVE_BYTES} bytes")


def click(page: Any, tab: str) -> None:
    """Turn to a tab, with the mouse: nothing is ever stable under software rendering."""
    box = page.get_by_role("tab", name=tab, exact=True).bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(SIZE[0] / 2, SIZE[1] - 5)


def main() -> None:
    """Make pictures."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("names", nargs="*", metavar="NAME", help="pictures (default: all)")
    with browser.running(browser.program() or "chromium") as chromium:
        for name in parser.parse_args().names or gallery.LIVE:
            content = picture(name, chromium)
            place_of(name).write_bytes(content)
            print(f"{name}: {len(content)} bytes")


if __name__ == "__main__":
    main()
