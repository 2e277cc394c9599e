"""Comparison of pinbound with coal, placed by Pinocchio: points, contacts, bodies, regions."""

from pinbound.crosscheck.bodies_level import BodyLevel, LinkPair
from pinbound.crosscheck.check import LEVELS, CrossCheck, Level, cross_check
from pinbound.crosscheck.contacts import BoundaryLevel, RayCheck
from pinbound.crosscheck.points import PointLevel
from pinbound.crosscheck.regions_level import RegionLevel

__all__ = [
    "LEVELS",
    "BodyLevel",
    "BoundaryLevel",
    "CrossCheck",
    "Level",
    "LinkPair",
    "PointLevel",
    "RayCheck",
    "RegionLevel",
    "cross_check",
]
