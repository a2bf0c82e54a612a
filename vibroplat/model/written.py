"""Prints the equations as kernels contain them: ``python -m vibroplat.model.written``."""

from __future__ import annotations

from vibroplat.kernels.on_demand import WRITERS
from vibroplat.model import accelerations, energy, series  # noqa: F401  (they import all others)

if __name__ == "__main__":
    print("\n\n".join(write().strip() for write in WRITERS))
