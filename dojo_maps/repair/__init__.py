"""Repair a network: one small function per check proposes edits, rounds keep those that make nothing worse."""
