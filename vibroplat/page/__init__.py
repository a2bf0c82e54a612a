"""A self-contained HTML page of results; it reads result tables alone."""
