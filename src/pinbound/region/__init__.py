"""Feasible regions in the plane of two coordinates."""

from pinbound.region.arrangement import Corner, Edge
from pinbound.region.feasible import feasible_region
from pinbound.region.margins import SmallestClearance
from pinbound.region.region import Region

__all__ = ["Corner", "Edge", "Region", "SmallestClearance", "feasible_region"]
