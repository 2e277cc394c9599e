"""Long campaigns and timings; their results go into docs/ with the command that makes them."""
