"""The reduced relative path of two marks, and its case."""
