"""Files: written at once and whole, ours told apart from the user's, shipped assets found wherever they are
installed."""
