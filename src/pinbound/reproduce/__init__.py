"""The paper reproduced: every table and figure drawn anew from the URDF, and its errata as computations."""

from pinbound.reproduce.findings import Equation, Erratum, Table
from pinbound.reproduce.page import Reproduction, reproduce_paper

__all__ = ["Equation", "Erratum", "Reproduction", "Table", "reproduce_paper"]
