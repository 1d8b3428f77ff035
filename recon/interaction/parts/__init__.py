"""Which parts there are: groups of tracks on one joint each, separated from hand and drifting tracks."""
