"""Files in, one description out. Everything read here is treated as hostile."""
