"""Studies of many motions: sweeps over any key, settling, classification, execution and storage."""
