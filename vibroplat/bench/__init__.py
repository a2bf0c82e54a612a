"""Benchmarks: run time against error, compared within one run."""
