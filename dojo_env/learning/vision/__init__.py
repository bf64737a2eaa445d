"""The network that sees lanes: it learns from pictures of which the environment knows all that is in them.

episodes   junctions, light, weather and cameras drawn from a seed -> strips, and what is on them
network    the network in torch
training   examples -> weights, how far they err, files
"""
