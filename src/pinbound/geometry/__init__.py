"""Nearest points of convex hulls: knows no robot."""
