"""Tests leave the compiler alone, but for those that are about it: hundreds of robots pass by.

What hypothesis draws is the same in every run.
"""

import os

from hypothesis import settings

os.environ["COPOSE_COMPILE"] = "0"
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
