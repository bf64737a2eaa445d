"""One policy for any junction: it learns at many of them at once, by proximal policy optimisation.

cases      which junctions, demands and constraints an episode has: drawn from a seed
rollouts   episodes in processes of their own -> what happened at each decision
network    the phases' scores and the junction's value, in torch
ppo        one update from the episodes of a round
training   rounds of both, validation, files
"""
