"""A page in which a user drags through a region and sees the robot move; a live view, which also shows meshes."""

from pinbound.explorer.assembled import ExplorerPage, explorer_page

__all__ = ["ExplorerPage", "explorer_page"]
