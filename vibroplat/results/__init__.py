"""Results: tables and their columns, files that are always complete, provenance, and runs as a user holds them."""
