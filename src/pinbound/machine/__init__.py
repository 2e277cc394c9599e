"""Machine code: Python functions into LLVM, and the cache of object code. Knows no robot."""
