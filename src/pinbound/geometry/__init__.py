"""Nearest points of convex hulls, and rotations; this room knows no robot."""
