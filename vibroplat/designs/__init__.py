"""What an orbit's measures depend on, what tolerances do to them, and which values of keys are best."""
