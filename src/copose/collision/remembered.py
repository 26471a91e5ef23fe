"""Capsules in the user's cache folder: they take seconds to fit, and a mesh does not change."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np

from copose.collision import capsules
from copose.collision.capsules import Capsule
from copose.kernels import cache
from copose.poses import Array, Indices, frozen_array

_SUFFIX = ".npy"


def remembered(
    fit: Callable[..., tuple[Capsule, ...]], *given: Array | Indices
) -> tuple[Capsule, ...]:
    """What a function makes of some arrays, from the cache where it has done so before."""
    code = hashlib.sha256(fit.__name__.encode() + Path(capsules.__file__).read_bytes())
    for array in given:
        code.update(np.ascontiguousarray(array).tobytes())
    key = code.hexdigest()[:32]
    known = cache.stored(key, _SUFFIX)
    if known is not None:
        rows = np.load(io.BytesIO(known[1]), allow_pickle=False)
        return tuple(
            Capsule(frozen_array(row[:3]), frozen_array(row[3:6]), float(row[6])) for row in rows
        )
    fitted = fit(*given)
    content = io.BytesIO()
    np.save(content, np.array([[*c.a, *c.b, c.radius] for c in fitted]))
    cache.store(key, _SUFFIX, content.getvalue())
    return fitted
