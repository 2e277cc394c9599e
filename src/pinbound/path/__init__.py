"""The reduced relative path of two marks: the one idea, and which case it is."""
