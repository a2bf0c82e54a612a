"""Prints the equations as kernels contain them: ``python -m vibroplat.model.written``."""

from __future__ import annotations

from vibroplat.model import straight

#: Writers of all texts.
WRITERS = (
    *(
        straight.all_rows,
        straight.dynamic_jacobian,
        straight.mass_matrix,
        straight.loads_on_rows,
        straight.rates_of_rows,
    ),
    straight.couplings,
)

if __name__ == "__main__":
    print("\n\n".join(write().strip() for write in WRITERS))
