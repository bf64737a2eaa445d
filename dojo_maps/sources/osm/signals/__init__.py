"""Stages and programs of signals, from the built network and its right of way."""
