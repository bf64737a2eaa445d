"""Who does what in an episode, one manager per concern; `world` holds them in one visible order."""
