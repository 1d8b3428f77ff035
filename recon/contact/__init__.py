"""Contact: which end of a joint is closed, and where the hand held the part."""
