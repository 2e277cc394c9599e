"""Feasible regions in the plane of two coordinates."""

from pinbound.region.region import Edge, Region, feasible_region

__all__ = ["Edge", "Region", "feasible_region"]
