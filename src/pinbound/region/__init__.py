"""Feasible regions in the plane of two coordinates, their image in the workspace, and membership in them."""

from pinbound.region.arrangement import Corner, Edge, Unresolved
from pinbound.region.feasible import feasible_region
from pinbound.region.margins import SmallestClearance
from pinbound.region.membership import Membership, Place, classify, region_membership
from pinbound.region.region import ConvexRegion, Region, TracedRegion
from pinbound.region.swept import SweptBody, swept_body
from pinbound.region.workspace import Section, workspace_section

__all__ = [
    "ConvexRegion",
    "Corner",
    "Edge",
    "Membership",
    "Place",
    "Region",
    "Section",
    "SmallestClearance",
    "SweptBody",
    "TracedRegion",
    "Unresolved",
    "classify",
    "feasible_region",
    "region_membership",
    "swept_body",
    "workspace_section",
]
