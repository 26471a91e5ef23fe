"""Tests leave the compiler alone, but for those that are about it: hundreds of robots pass by.

With ``COPOSE_COMPILE=1`` in the environment all of them wait for it, and run on compiled kernels
alone. What hypothesis draws is the same in every run.
"""

import os

from hypothesis import settings

from copose import kernels

if os.environ.setdefault("COPOSE_COMPILE", "0") != "0":
    build = kernels.build
    kernels.build = lambda made, *, wait=False: build(made, wait=True)

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
