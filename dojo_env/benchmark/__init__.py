"""The benchmark: rows of controllers and learners on scenarios, their results in files, and the tables."""
