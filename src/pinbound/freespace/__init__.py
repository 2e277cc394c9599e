"""Free space in all coordinates, proven: polytopes, volumes, motions; `docs/free-space.md` has the argument."""

from pinbound.freespace.cover import certified_cover
from pinbound.freespace.cover_files import load_cover
from pinbound.freespace.cover_records import ConvexSet, FreeCover
from pinbound.freespace.faces import Face
from pinbound.freespace.paving import FreeVolume, free_volume
from pinbound.freespace.planning import Plan, plan
from pinbound.freespace.polytope import certified_polytope
from pinbound.freespace.projection import FreeProjection, free_projection
from pinbound.freespace.records import FreePolytope

__all__ = [
    "ConvexSet",
    "Face",
    "FreeCover",
    "FreePolytope",
    "FreeProjection",
    "FreeVolume",
    "Plan",
    "certified_cover",
    "certified_polytope",
    "free_projection",
    "free_volume",
    "load_cover",
    "plan",
]
