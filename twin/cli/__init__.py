"""The command line: arguments, verbs, and what a terminal shows."""
