"""Studies made of many motions: sweeps, regimes, the paper's claims, calibration."""
