"""Pages in a headless Chromium, for tests that look at what a browser shows.

``chromium`` is a pytest fixture of conftest.py: a browser of its module's tests, or a skip that
says why. Playwright keeps an event loop in its thread as long as it runs, so that it ends with the
module: other tests run loops of their own.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import ArrayLike

# How long a browser may take over one step on a busy machine, in seconds.
PATIENCE = 60.0
# Names of the program, the first that is there counts.
PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Software rendering, no sandbox (tests may run as root), and no calls home.
OPTIONS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)
# Hosts that are this machine.
OWN_HOSTS = ("127.0.0.1", "localhost", "[::1]", "::1")
# Schemes of addresses that need no network.
OWN_SCHEMES = ("file", "data", "blob", "about")

# The camera's projection of a point in viser's world, whose root turns z up to y up.
_PIXEL = """([x, y, z]) => {
  const m = window.__viserMutable, box = m.canvas.getBoundingClientRect();
  m.camera.updateMatrixWorld();
  const p = m.camera.position.clone().set(x, y, z);
  m.nodeRefFromName[""].localToWorld(p).project(m.camera);
  return [box.x + (1 + p.x) / 2 * box.width, box.y + (1 - p.y) / 2 * box.height, p.z];
}"""
# A node's position in viser's world and its quaternion there, w first; null while it is not drawn.
_POSE = """name => {
  const nodes = window.__viserMutable?.nodeRefFromName;
  const node = nodes?.[name], root = nodes?.[""];
  if (!node || !root) return null;
  root.updateWorldMatrix(true, false);
  node.updateWorldMatrix(true, false);
  const local = root.matrixWorld.clone().invert().multiply(node.matrixWorld);
  const at = node.position.clone(), q = node.quaternion.clone(), scale = node.scale.clone();
  local.decompose(at, q, scale);
  return [at.x, at.y, at.z, q.w, q.x, q.y, q.z];
}"""
_FRAMES = "() => window.__viserTestpoints?.rendererInfo.render.frame ?? 0"


@dataclass(frozen=True)
class View:
    """A browser's page, what it asked the network for and what it complained of.

    Attributes:
        page: Playwright's page.
        requests: the addresses asked for so far, websockets too.
        errors: what the console called an error, and exceptions nobody caught.
    """

    page: Any
    requests: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    @property
    def foreign(self) -> list[str]:
        """The addresses asked for that are not of this machine."""
        return [address for address in self.requests if not _own(address)]

    def open(self, address: str, *nodes: str) -> None:
        """Go to a viser page and wait until it draws, and has these nodes in its scene."""
        self.page.goto(address, wait_until="domcontentloaded", timeout=1000 * PATIENCE)
        self.until("() => window.__viserMutable?.nodeRefFromName['']")
        self.wait_for(*nodes)
        begun = self.frames()
        self.until(f"() => ({_FRAMES})() > {begun}")

    def until(self, condition: str, argument: object = None) -> None:
        """Wait until a JavaScript function of the page returns something true."""
        self.page.wait_for_function(condition, arg=argument, timeout=1000 * PATIENCE, polling=50)

    def wait_for(self, *nodes: str) -> None:
        """Wait until the scene has nodes of these names, such as ``/object``, and shows them."""
        shown = """names => names.every(name => {
          const node = window.__viserMutable?.nodeRefFromName[name];
          if (!node) return false;
          for (let n = node; n; n = n.parent) if (!n.visible) return false;
          return true;
        })"""
        self.until(shown, list(nodes))

    def nodes(self) -> list[str]:
        """The names of the scene's nodes."""
        return self.page.evaluate("() => Object.keys(window.__viserSceneTree.getState())")

    def pose(self, node: str) -> np.ndarray | None:
        """Where the page draws a node in the world: x, y, z and quaternion w, x, y, z, (7,)."""
        found = self.page.evaluate(_POSE, node)
        return None if found is None else np.array(found)

    def pixel(self, point: ArrayLike) -> np.ndarray:
        """The page's pixel at which a point of the world is drawn, (2,): right and down."""
        x, y, depth = self.page.evaluate(_PIXEL, np.asarray(point, float).tolist())
        assert -1 < depth < 1 and math.isfinite(x + y), "the point is not before the camera"
        return np.array([x, y])

    def drag(
        self, start: ArrayLike, end: ArrayLike, steps: int = 8, *, pause: float = 0.05
    ) -> None:
        """Press the mouse at one pixel, move it to another in steps and let it go.

        Before the press it rests a moment over the start: gizmos look for it as they are drawn.
        """
        begin, finish = np.asarray(start, float), np.asarray(end, float)
        mouse = self.page.mouse
        mouse.move(*(begin - 3))
        mouse.move(*begin)
        self.draw()
        mouse.down()
        self.draw()
        for k in range(1, steps + 1):
            mouse.move(*(begin + (finish - begin) * k / steps))
            self.page.wait_for_timeout(1000 * pause)
        self.draw()
        mouse.up()

    def frames(self) -> int:
        """The number of pictures drawn since the page was opened."""
        return int(self.page.evaluate(_FRAMES))

    def draw(self) -> None:
        """Wait for one more picture to be drawn."""
        begun = self.frames()
        self.page.evaluate("() => window.__viserMutable.requestRender()")
        self.until(f"() => ({_FRAMES})() > {begun}")

    def eventually(self, condition: Callable[[], object], patience: float = PATIENCE) -> None:
        """Wait for something of Python's to come true, while the page goes on."""
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, "waited in vain"
            self.page.wait_for_timeout(20)


def program() -> str | None:
    """Where this machine's Chromium or Chrome is."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


@dataclass(frozen=True)
class Chromium:
    """A running browser.

    Attributes:
        browser: Playwright's browser.
    """

    browser: Any

    @contextlib.contextmanager
    def view(self, size: Sequence[int] = (1000, 700)) -> Iterator[View]:
        """A new page of this size in pixels, with nothing remembered of others."""
        context = self.browser.new_context(viewport={"width": size[0], "height": size[1]})
        page = context.new_page()
        view = View(page)
        # The context tells of the requests of workers too.
        context.on("request", lambda request: view.requests.append(request.url))
        page.on("websocket", lambda socket: view.requests.append(socket.url))
        page.on("pageerror", lambda error: view.errors.append(str(error)))
        page.on(
            "console",
            lambda message: view.errors.append(message.text) if message.type == "error" else None,
        )
        try:
            yield view
        finally:
            context.close()


@contextlib.contextmanager
def running(path: str) -> Iterator[Chromium]:
    """A headless browser of this program."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(OPTIONS))
        try:
            yield Chromium(browser)
        finally:
            browser.close()


def _own(address: str) -> bool:
    parts = urlsplit(address)
    return parts.scheme in OWN_SCHEMES or parts.hostname in OWN_HOSTS
