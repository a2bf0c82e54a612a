"""What a program needs of its system: signals, streams, memory and a terminal for its progress."""
