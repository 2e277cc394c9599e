"""Closed loops: parallelograms, the proof that they close, and what their errors do to a distance."""
