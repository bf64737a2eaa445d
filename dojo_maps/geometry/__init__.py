"""From the description to shapes on the ground: who owns which piece of it, and what is painted there."""
