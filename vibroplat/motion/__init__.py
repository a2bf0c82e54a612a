"""One motion, advanced in time."""
