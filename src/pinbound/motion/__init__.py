"""Motions from files and over time, and inverse kinematics."""

from pinbound.motion.history import Motion, MotionHistory, history, read_motion

__all__ = ["Motion", "MotionHistory", "history", "read_motion"]
