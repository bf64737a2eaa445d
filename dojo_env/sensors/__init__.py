"""Sensors: what one is, the kinds there are, where they hang, and what their pictures suffer from."""
