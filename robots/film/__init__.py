"""Films: a replay seen from a good place, beside the recording."""
