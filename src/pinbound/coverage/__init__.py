"""Which bodies are held by marks, which pairs of links are watched, which are left out and why, which nobody looks at.

A boundary speaks of its two marks. What it says of bodies depends on whether the marks hold them; that is proven here,
once for a robot, and said with every verdict. `docs/coverage.md`.
"""

from pinbound.coverage.records import Basis, BodyCoverage, CoverageRecord, LinkCoverage, PairCoverage, Status
from pinbound.coverage.survey import Coverage

__all__ = ["Basis", "BodyCoverage", "Coverage", "CoverageRecord", "LinkCoverage", "PairCoverage", "Status"]
