"""A page in which one drags through a region and sees the robot move, and the same live with meshes."""

from pinbound.explorer.assembled import ExplorerPage, explorer_page

__all__ = ["ExplorerPage", "explorer_page"]
