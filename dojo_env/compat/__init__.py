"""Other projects' interfaces over this environment, for scripts that were written for them."""
