"""Files: written at once and whole, ours distinguished from the user's, assets found wherever installed."""
