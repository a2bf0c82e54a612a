"""The hybrid solver: modes joined by transitions, advanced by an engine."""
