"""Boundaries as code and data for other programs: C, CasADi, chains as JSON, ROS 2 limits, half-spaces for Drake."""

from pinbound.export.c_source import c_files
from pinbound.export.casadi_functions import casadi_function
from pinbound.export.chains import chains_record
from pinbound.export.drake import drake_text, half_spaces, save_drake_regions
from pinbound.export.half_spaces import half_spaces_text, write_half_spaces
from pinbound.export.nodes import SignedNodes, is_closed, signed_nodes
from pinbound.export.ros2 import ros2_text

__all__ = [
    "SignedNodes",
    "c_files",
    "casadi_function",
    "chains_record",
    "drake_text",
    "half_spaces",
    "half_spaces_text",
    "is_closed",
    "ros2_text",
    "save_drake_regions",
    "signed_nodes",
    "write_half_spaces",
]
