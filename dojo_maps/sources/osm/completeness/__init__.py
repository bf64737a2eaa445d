"""What of the source the built network keeps, and what it lacks."""
