"""Machine code: translation of Python functions to LLVM, and the cache of object code. It knows no robot."""
