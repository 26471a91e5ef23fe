"""How quickly the arms on the live page follow a hand, and whether anything ever freezes.

A headless Chromium has the page open, where there is one; drags are made in Python, as the
handlers of the page make them. Figures: from the handler's call to the sending of the new joints,
and processor time of solving and drawing, apart from the browser's.

    python benchmarks/live.py [PROBLEM.toml] [--drags 1000] [--no-browser]
"""

from __future__ import annotations

import argparse
import contextlib
import resource
import shutil
import sys
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import copose
from copose.live.page import Page
from copose.live.problem_file.document import Changes
from copose.live.scene.gizmos import Gizmo
from copose.poses import Array, Pose

PROBLEM = Path(__file__).parent.parent / "problems" / "two-panda-box.toml"
# Options of Chromium without a screen.
OPTIONS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
           "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
           "--disable-background-networking"]  # fmt: skip
OBJECT = Gizmo("object")
# Of drags are beyond reach.
BEYOND = 3
# Between drags, s: as often as a browser tells of them.
EVERY = 0.033


@contextlib.contextmanager
def browser(address: str) -> Iterator[float]:
    """A headless browser that has the page open; yields the seconds until it was drawn."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=OPTIONS)
        page = chromium.new_page(viewport={"width": 900, "height": 600})
        began = time.perf_counter()
        page.goto(address)
        drawn = "() => window.__viserMutable?.nodeRefFromName['/object']"
        page.wait_for_function(drawn, timeout=120_000)
        yield time.perf_counter() - began
        chromium.close()


class Answers(deque[float]):
    """Latencies, with when handlers were called and when their answers were handed over."""

    def __init__(self, page: Page) -> None:
        super().__init__()
        self.begun: list[float] = []
        self.given: list[float] = []
        self._flushed, flush = 0.0, type(page.server).flush

        def flushed() -> None:
            # The event loop may send while this thread still waits for its turn.
            self._flushed = time.perf_counter()
            flush(page.server)

        page.server.flush = flushed

    def append(self, latency: float) -> None:
        """Put one down."""
        self.begun.append(time.perf_counter() - latency)
        self.given.append(self._flushed)
        super().append(latency)

    def sent(self, sends: list[float]) -> Array:
        """From each handler's call to the end of the first sending after its answer, s."""
        times = np.array(sends)
        after = np.searchsorted(times, self.given)
        known = after < len(times)
        return times[after[known]] - np.array(self.begun)[known]


@contextlib.contextmanager
def sendings() -> Iterator[list[float]]:
    """When messages to browsers were sent, s on the clock of `time.perf_counter`."""
    from websockets.asyncio.server import ServerConnection

    send, times = ServerConnection.send, []

    async def timed(self: ServerConnection, *given: object, **named: object) -> None:
        await send(self, *given, **named)
        times.append(time.perf_counter())

    ServerConnection.send = timed
    try:
        yield times
    finally:
        ServerConnection.send = send


def memory() -> float:
    """Of this process now, MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def places(count: int, start: Pose, far: float) -> Array:
    """Where the object is dragged: a walk around the start, each third step beyond reach."""
    rng = np.random.default_rng(0)
    steps = rng.normal(scale=0.01, size=(count, 3))
    walk = np.zeros((count, 3))
    for k in range(1, count):
        walk[k] = 0.97 * walk[k - 1] + steps[k]
    beyond = np.arange(count) % BEYOND == BEYOND - 1
    walk[beyond] += [0.0, far, 0.0]
    return start.position + walk


def main() -> None:
    """Drag, and print what it took."""
    parser = argparse.ArgumentParser()
    parser.add_argument("problem", nargs="?", type=Path, default=PROBLEM)
    parser.add_argument("--drags", type=int, default=1000)
    parser.add_argument("--no-browser", action="store_true")
    arguments = parser.parse_args()
    problem = copose.load(arguments.problem)
    copose.Planner(problem, movable=True).compile()
    began = time.perf_counter()
    page = Page(problem, host="127.0.0.1", port=0)
    print(f"server up {time.perf_counter() - began:.2f} s after its start")
    shown = contextlib.nullcontext(float("nan"))
    with sendings() as sends, shown if arguments.no_browser else browser(page.address) as drawn:
        print(f"drawn {drawn:.2f} s after the browser was told the address")
        page.settle()
        start = problem.object.pose
        drag(page, start, arguments.drags, sends, far=0.0, title="within reach")
        drag(page, start, arguments.drags, sends, far=2.0, title="a third beyond reach")
    page.stop()


def drag(
    page: Page, start: Pose, count: int, sends: list[float], *, far: float, title: str
) -> None:
    """Drag the object and print times."""
    page.latencies = answers = Answers(page)
    moved, worked = type(page.session).move, []

    def move(changes: Changes) -> None:
        began = time.thread_time()
        moved(page.session, changes)
        worked.append(time.thread_time() - began)

    page.session.move = move
    page.drag(OBJECT, start, "start")
    spent, before, longest = time.process_time(), memory(), 0.0
    last, answered = time.perf_counter(), 0
    for k, position in enumerate(places(count, start, far)):
        page.drag(OBJECT, Pose.make(position, start.rotation, start.quaternion))
        time.sleep(EVERY)
        now = time.perf_counter()
        if len(page.latencies) > answered or k == 0:
            longest, last, answered = max(longest, now - last), now, len(page.latencies)
    spent = time.process_time() - spent
    page.drag(OBJECT, start, "end")
    page.settle()
    times = 1e3 * (answers.sent(sends) if sends else np.array(answers))
    print(
        f"{title}: {len(times)} of {count} drags answered, median {np.median(times):.1f} ms, "
        f"95 % {np.percentile(times, 95):.1f} ms, most {times.max():.0f} ms; longest time without "
        f"an answer {longest:.2f} s; processor time of solve and scene "
        f"{1e3 * np.median(worked):.1f} ms, of the whole process "
        f"{1e3 * spent / len(times):.1f} ms each; memory "
        f"{before:.0f} → {memory():.0f} MB"
    )


if __name__ == "__main__":
    sys.exit(main())
