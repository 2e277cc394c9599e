"""Certified bounds of a path over boxes and motions, rounding included."""
