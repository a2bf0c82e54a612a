"""What ``vibroplat bench`` measures on the machine at hand: run time and errors of engines and of other solvers."""
