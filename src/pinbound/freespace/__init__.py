"""Proven free space in all coordinates: polytopes, volumes, covers, motions; `docs/free-space.md` has the proofs."""

from pinbound.freespace.atlas import pair_atlas
from pinbound.freespace.atlas_files import load_atlas
from pinbound.freespace.atlas_records import AtlasGroup, AtlasPair, PairAtlas
from pinbound.freespace.cover import certified_cover
from pinbound.freespace.cover_files import load_cover
from pinbound.freespace.cover_records import ConvexSet, FreeCover
from pinbound.freespace.faces import Face
from pinbound.freespace.pair_sets import Where
from pinbound.freespace.paving import FreeVolume, free_volume
from pinbound.freespace.planning import Plan, plan
from pinbound.freespace.polytope import certified_polytope
from pinbound.freespace.projection import FreeProjection, free_projection
from pinbound.freespace.records import FreePolytope

__all__ = [
    "AtlasGroup",
    "AtlasPair",
    "ConvexSet",
    "Face",
    "FreeCover",
    "FreePolytope",
    "FreeProjection",
    "FreeVolume",
    "PairAtlas",
    "Plan",
    "Where",
    "certified_cover",
    "certified_polytope",
    "free_projection",
    "free_volume",
    "load_atlas",
    "load_cover",
    "pair_atlas",
    "plan",
]
