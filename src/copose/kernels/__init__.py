"""Small expressions evaluated on many points at once, compiled where a C compiler is found."""

from copose.kernels.kernel import Kernel, build

__all__ = ["Kernel", "build"]
