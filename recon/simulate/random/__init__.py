"""Random recordings: furniture, people, rooms and cameras that are drawn from a seed."""
