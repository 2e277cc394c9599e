"""Certified bounds of a path over boxes and motions, with rounding included."""
