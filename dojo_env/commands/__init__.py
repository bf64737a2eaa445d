"""A module per command of `dojo-env`: its options, and what it does."""
