"""The equations of motion, compiled; no integrator in here."""
