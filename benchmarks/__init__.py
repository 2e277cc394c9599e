"""Speed of pinbound beside its peers: `pytest benchmarks`, or `python -m benchmarks.report` for docs/performance.md."""
