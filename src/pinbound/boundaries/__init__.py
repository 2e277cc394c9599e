"""`Boundary` and `BoundarySet`: what users ask of two marks, and of all of them together."""
