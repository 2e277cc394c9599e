"""`Robot`, the central object for users, and `load`, which makes it from files."""

from pinbound.robot.loading import load
from pinbound.robot.robot import Robot

__all__ = ["Robot", "load"]
