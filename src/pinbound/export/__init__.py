"""Boundaries as code and data for others: C source, CasADi functions, chains as JSON."""

from pinbound.export.c_source import c_files
from pinbound.export.casadi_functions import casadi_function
from pinbound.export.chains import chains_record
from pinbound.export.half_spaces import half_spaces_text, write_half_spaces
from pinbound.export.nodes import SignedNodes, is_closed, signed_nodes

__all__ = [
    "SignedNodes",
    "c_files",
    "casadi_function",
    "chains_record",
    "half_spaces_text",
    "is_closed",
    "signed_nodes",
    "write_half_spaces",
]
