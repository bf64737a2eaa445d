"""Repairs: what a check finds, mended by reviewable patches in SUMO's plain XML."""
