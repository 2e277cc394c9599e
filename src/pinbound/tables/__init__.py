"""Tables of numbers in files: CSV, NPY, NPZ and Parquet, read with one set of rules for motions and for batches."""

from pinbound.tables.rules import BLOCK
from pinbound.tables.table import SUFFIXES, Table, open_table, read_table

__all__ = ["BLOCK", "SUFFIXES", "Table", "open_table", "read_table"]
