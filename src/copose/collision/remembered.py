"""Capsules in the user's cache folder: they take seconds to fit, and a mesh does not change."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from copose.collision import capsules
from copose.collision.capsules import Capsule
from copose.kernels.cache import folder
from copose.poses import Array, Indices, frozen_array


def remembered(
    fit: Callable[..., tuple[Capsule, ...]], *given: Array | Indices
) -> tuple[Capsule, ...]:
    """What a function makes of some arrays, from the cache where it has done so before."""
    place = folder()
    if place is None:
        return fit(*given)
    code = hashlib.sha256(fit.__name__.encode() + Path(capsules.__file__).read_bytes())
    for array in given:
        code.update(np.ascontiguousarray(array).tobytes())
    file = place / f"{code.hexdigest()[:32]}.npy"
    with contextlib.suppress(OSError, ValueError):
        rows = np.load(file, allow_pickle=False)
        if rows.ndim == 2 and rows.shape[1] == 7 and np.isfinite(rows).all():
            return tuple(
                Capsule(frozen_array(row[:3]), frozen_array(row[3:6]), float(row[6]))
                for row in rows
            )
    found = fit(*given)
    with contextlib.suppress(OSError):
        _write(file, np.array([[*c.a, *c.b, c.radius] for c in found]))
    return found


def _write(file: Path, rows: Array) -> None:
    """Whole or not at all."""
    handle, name = tempfile.mkstemp(dir=file.parent, suffix=".npy")
    try:
        with os.fdopen(handle, "wb") as sink:
            np.save(sink, rows)
        Path(name).replace(file)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
