"""Repair a network: a function per check proposes edits, rounds keep those that make nothing worse."""
