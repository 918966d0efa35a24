"""Names of units and their factors to SI."""
