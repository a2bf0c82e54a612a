"""Run time against error, measured side by side in one run."""
