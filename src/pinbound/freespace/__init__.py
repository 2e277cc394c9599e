"""Free space in all coordinates, proven: polytopes, volumes, motions; `docs/free-space.md` has the argument."""

from pinbound.freespace.faces import Face
from pinbound.freespace.paving import FreeVolume, free_volume
from pinbound.freespace.planning import Plan, plan
from pinbound.freespace.polytope import certified_polytope
from pinbound.freespace.records import FreePolytope

__all__ = ["Face", "FreePolytope", "FreeVolume", "Plan", "certified_polytope", "free_volume", "plan"]
