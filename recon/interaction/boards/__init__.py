"""Boards: surfaces that leave their place, grown to their edges, and the joints that carry them."""
