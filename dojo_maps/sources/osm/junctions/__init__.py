"""Which vertices are one junction."""
