"""Checks on a map: each has an id, a severity and a limit, and turns what it finds into issues."""
