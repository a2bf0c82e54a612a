"""What can go wrong, as the user is told of it."""

from __future__ import annotations


class VibroplatError(Exception):
    """Base of all errors that vibroplat raises on purpose; its text is one line for the user."""


class ConfigError(VibroplatError):
    """A configuration that cannot be used; the text names the key, the value and what is allowed."""


class TableError(VibroplatError):
    """A result table that cannot be written or read."""


class EngineError(VibroplatError):
    """An integrator that cannot be set up at all (a missing library, options it refuses)."""
