"""Interpreters of the reduced relative path: one question each, none knows another."""
