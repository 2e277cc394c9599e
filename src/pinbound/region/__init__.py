"""Feasible regions in the plane of two coordinates."""

from pinbound.region.arrangement import Corner, Edge
from pinbound.region.margins import SmallestClearance
from pinbound.region.region import Region, feasible_region

__all__ = ["Corner", "Edge", "Region", "SmallestClearance", "feasible_region"]
