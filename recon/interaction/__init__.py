"""One window solved: what moves in it, by which joints, and which pixels show it."""
