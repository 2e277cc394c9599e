"""Closed loops: parallelograms, the proof that they close, and the effect of their errors on a distance."""
