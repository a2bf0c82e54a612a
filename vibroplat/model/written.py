"""Prints the equations as kernels contain them: ``python -m vibroplat.model.written``."""

from __future__ import annotations

from vibroplat.model import balances, recurrences, straight

#: Writers of all texts.
WRITERS = (
    *(
        straight.all_rows,
        straight.dynamic_jacobian,
        straight.mass_matrix,
        straight.loads_on_rows,
        straight.rates_of_rows,
    ),
    *(straight.torque_of_one, straight.torques, straight.resistances),
    *(straight.couplings, recurrences.plain, recurrences.along),
    *(balances.slopes, balances.elastic, balances.curved_means, balances.foundation_forces),
)

if __name__ == "__main__":
    print("\n\n".join(write().strip() for write in WRITERS))
