"""`Boundary` and `BoundarySet`: the public methods for two marks, and for all boundaries together."""
