"""Tests leave the compiler alone, but for those that are about it: hundreds of robots pass by."""

import os

os.environ["COPOSE_COMPILE"] = "0"
