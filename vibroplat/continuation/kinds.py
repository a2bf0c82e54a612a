"""Kinds of special points of branches."""

from __future__ import annotations

FOLD, DOUBLING, TORUS, BRANCH_POINT = "fold", "period-doubling", "neimark-sacker", "branch-point"
LIFTOFF, END_OF_STICKING, GRAZING = "liftoff", "end-of-sticking", "grazing"

#: What happens at each kind, for people.
KINDS = {
    FOLD: "two orbits merge and vanish",
    DOUBLING: "an orbit of twice the period branches off",
    TORUS: "quasi-periodic motion branches off",
    BRANCH_POINT: "another branch crosses, as where symmetry breaks",
    LIFTOFF: "contact is lost for the first time",
    END_OF_STICKING: "the material no longer stays on the platform after it lands",
    GRAZING: "an impact appears or vanishes with zero speed",
}
