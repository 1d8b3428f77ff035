"""Planning: where the base stands, the joints over time, clear of collisions and inside all limits."""
