"""Long campaigns and timings; their results go into docs/ with the command that makes them.

`pytest benchmarks`, or `python -m benchmarks.report` for docs/performance.md: speed beside its peers.
"""
