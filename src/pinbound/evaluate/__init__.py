"""Values of a path at one q or at many: distances, nearest points, derivatives, depth, formulas."""
