"""The roads of an extract as a graph of sections between vertices."""
