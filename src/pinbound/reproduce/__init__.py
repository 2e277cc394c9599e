"""The paper reproduced: Tables 3 to 14 and Figs. 8 to 22, computed from the URDF, and its errata as computations."""

from pinbound.reproduce.findings import Equation, Erratum, Table
from pinbound.reproduce.page import Reproduction, reproduce_paper

__all__ = ["Equation", "Erratum", "Reproduction", "Table", "reproduce_paper"]
