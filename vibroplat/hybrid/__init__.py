"""Modes and transitions of a run."""
