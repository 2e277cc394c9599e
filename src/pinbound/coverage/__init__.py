"""Coverage: which bodies marks hold, and which pairs of links are watched, left out (with the reason), or open.

A boundary is about its two marks. It is a statement about bodies only if the marks hold them. This room proves that
once for each robot, and every verdict states it. `docs/coverage.md`.
"""

from pinbound.coverage.records import Basis, BodyCoverage, CoverageRecord, LinkCoverage, PairCoverage, Status
from pinbound.coverage.survey import Coverage

__all__ = ["Basis", "BodyCoverage", "Coverage", "CoverageRecord", "LinkCoverage", "PairCoverage", "Status"]
