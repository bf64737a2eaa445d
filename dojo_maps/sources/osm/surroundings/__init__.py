"""What stands around the roads: buildings, trees, water, green."""
