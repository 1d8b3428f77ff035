"""Which parts there are: groups of tracks that one joint each carries, told from the hand and from drifting
tracks."""
