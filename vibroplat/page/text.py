"""Texts on the page."""

from __future__ import annotations

import html

from vibroplat.errors import escape_controls


def escape(text: str) -> str:
    """Return a text as HTML; characters of control are shown."""
    return html.escape(escape_controls(text))
