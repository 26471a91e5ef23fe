"""What a run ran on."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import subprocess
from pathlib import Path

_PACKAGES = ("copose", "casadi", "numpy", "scipy", "pin", "drake")


def facts() -> dict[str, str]:
    """CPU model, cores, compiler and versions."""
    found = {"CPU": _cpu(), "cores": str(os.cpu_count()), "Python": platform.python_version()}
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    found["C compiler"] = _first_line(compiler) if compiler else "none"
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            if package != "copose":
                found[package] = "not installed"
    return found


def _cpu() -> str:
    listing = Path("/proc/cpuinfo")
    if listing.exists():
        for line in listing.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _first_line(compiler: str) -> str:
    answer = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return (answer.stdout.splitlines() or [compiler])[0]
