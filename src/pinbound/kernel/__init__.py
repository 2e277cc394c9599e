"""The batch kernel: norms, clearances, gradients and smallest clearances of a whole set, at the speed of the hardware.

`scalars` and `program` define what is computed, once for the set. `source` and `compiled` turn it into machine code by
Numba (extra `fast`), and `object_cache` keeps the code for later processes. `vectorised` runs the program in NumPy,
without Numba or if there is too little work to compile for. `choice` chooses, and `engine` runs it. Sets of many marked
points use tables (`balls`, `ball_kernel`).
"""

from pinbound.kernel.arguments import BACKENDS, Backend, check_choices
from pinbound.kernel.ball_kernel import BallKernel
from pinbound.kernel.engine import Kernel
from pinbound.kernel.mixed import MixedKernel, kernel_of
from pinbound.kernel.program import CommonMark, Pair, Reference
from pinbound.kernel.union import UnionKernel

__all__ = [
    "BACKENDS",
    "Backend",
    "BallKernel",
    "CommonMark",
    "Kernel",
    "MixedKernel",
    "Pair",
    "Reference",
    "UnionKernel",
    "check_choices",
    "kernel_of",
]
