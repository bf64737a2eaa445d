"""Signal engineering on a description: programs, who conflicts with whom, and the times that changes need."""
