"""Signals as an engineer sees them: what conflicts, which phases there are, how one follows another."""
