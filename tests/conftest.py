"""Tests leave the compiler alone, but for those that are about it: hundreds of robots pass by.

With ``COPOSE_COMPILE=1`` in the environment all of them wait for it, and run on compiled kernels
alone. What hypothesis draws is the same in every run.

A test with many cases that are alike is marked ``few(n)``: n of them run, drawn once for all. The
rest are marked ``long``, as tests are that take minutes: ``pytest -m long`` runs these.
"""

import os
import random
from collections import defaultdict
from collections.abc import Iterator

# Workers side by side would each let BLAS wait for threads that have no core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

import browser
from copose import kernels

if os.environ.setdefault("COPOSE_COMPILE", "0") != "0":
    build = kernels.build
    kernels.build = lambda made, *, wait=False: build(made, wait=True)

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    families = defaultdict(list)
    for item in items:
        mark = item.get_closest_marker("few")
        if mark is not None:
            families[item.nodeid.split("[")[0], *mark.args].append(item)
    for (name, count), family in families.items():
        drawn = random.Random(name).sample(range(len(family)), min(count, len(family)))
        for k, item in enumerate(family):
            if k not in drawn:
                item.add_marker(pytest.mark.long)


@pytest.fixture(scope="module")
def chromium() -> Iterator[browser.Chromium]:
    """A headless browser; without one the tests that ask for it are left out."""
    path = browser.program()
    if path is None:
        pytest.skip("no chromium or google-chrome on this machine: browser tests are left out")
    with browser.running(path) as run:
        yield run
