"""What is read from a run's steps: trajectory, events, statistics, energy audit."""
