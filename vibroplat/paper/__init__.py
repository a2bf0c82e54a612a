"""One paper reproduced: its claims, the evidence for them, its machines, β and the calibration."""
