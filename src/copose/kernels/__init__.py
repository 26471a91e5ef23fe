"""Small expressions evaluated on many points at once, compiled where a C compiler is found."""

from copose.kernels.kernel import Kernel, build
from copose.kernels.lock import one_at_a_time

__all__ = ["Kernel", "build", "one_at_a_time"]
