"""What netconvert builds of the plain XML, and what of it the next attempt must do otherwise."""
