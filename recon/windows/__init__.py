"""Windows: when something is handled in a recording of minutes."""
