"""One policy for any junction: it learns at many of them at once, from phases that are compared by forks.

cases        which junctions, demands and constraints an episode has: drawn from a seed
branches     episodes in forks; at some decisions one more fork for each phase -> what each would cost
network      the phases' scores, in torch
improvement  decisions that have been compared -> better weights
training     rounds of both, validation, files
joining      several policies -> one
"""
