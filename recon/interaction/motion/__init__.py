"""Motion: when something moves, which tracks move together by one joint, which are the hand."""
