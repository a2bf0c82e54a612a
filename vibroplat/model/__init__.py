"""The equations: mass matrix, forces, motors, contact, impacts, energies."""
