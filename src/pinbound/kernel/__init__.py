"""The batch kernel: norms, clearances, gradients and smallest clearances of a whole set, at the speed of the hardware.

`scalars` and `program` say what is computed, once for the set; `source` and `compiled` turn that into machine code by
Numba (extra `fast`), which `object_cache` keeps for later processes; `vectorised` runs it in NumPy
where there is no Numba, or too little work to compile for; `choice` chooses, and `engine` runs it.
Many marked points run by tables (`balls`, `ball_kernel`).
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
