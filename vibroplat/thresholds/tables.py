"""The tables of a search for thresholds: what their columns mean."""

from __future__ import annotations

from vibroplat.columns import COUNT, TEXT, Column, Columns
from vibroplat.continuation.special_points import KINDS
from vibroplat.observe.conveying import CONVEYING
from vibroplat.report.data_sheet import SHEET, point_columns
from vibroplat.study.sweep import COLUMNS, SWEEP

#: Columns of a sweep that are given for both sides of a threshold.
SIDE_COLUMNS = (
    *("sync", "motion", "period", "multiplier_max", "excitation_frequency_hz", "rms_x_m", "rms_y_m"),
    *("phase_difference_rad", "motor_power_w"),
)
#: Kinds of thresholds.
KINDS_OF_CHANGE = {
    "jump": "both sides keep their outcome with twice the settling time; their measures differ at any distance",
    "level-crossing": "the difference of the measures vanishes as the interval between both sides shrinks",
    "opposite-crossing": "an angle passes the value half a turn from the level, where what is above the level ends; "
    "the level is not crossed",
    "not-narrowed": "attractors in the range cannot be told apart, because motion near a change does not repeat",
    "unresolved-transient": "one side changes with twice the settling time, or is still leaving an unstable orbit",
}
#: What the columns mean.
THRESHOLDS: Columns = {
    "key": Column("dotted name of the varied key", kind=TEXT),
    "below": Column("largest evaluated value of the key below the threshold"),
    "above": Column("smallest evaluated value of the key above the threshold"),
    "value": Column("the threshold", "special point if an orbit loses stability there; otherwise the middle"),
    "kind": Column(
        "kind of threshold", "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS_OF_CHANGE.items()), kind=TEXT
    ),
    "special_point": Column("special point of the orbit", f"{', '.join(KINDS)}; empty if there is none", kind=TEXT),
    "mixed_low": Column(
        "smallest value of the mixed interval",
        "outcomes alternate between mixed_low and mixed_high, or a value changes with twice the settling time; "
        "empty if no evaluated value contradicts the threshold",
    ),
    "mixed_high": Column("largest value of the mixed interval"),
    "clear_below": Column(
        "value below the threshold or mixed interval", "the nearest with many starts, or else any; all have one outcome"
    ),
    "starts_below": Column("number of starts there", "each with another seed", kind=COUNT),
    "tried_below": Column("number of these starts and of those further below", "all have one outcome", kind=COUNT),
    "tried_down_to": Column("smallest of the tried_below values", "it ends at another threshold or the range"),
    "clear_above": Column("the same above it"),
    "starts_above": Column("number of starts there", "each with another seed", kind=COUNT),
    "tried_above": Column("number of these starts and of those further above", "see tried_below", kind=COUNT),
    "tried_up_to": Column("largest of the tried_above values"),
    **{f"{side}_{name}": SWEEP[name] for side in ("below", "above") for name in SIDE_COLUMNS},
}
#: Columns of an evaluated value that are those of a point of a sweep.
POINT_COLUMNS = tuple(name for name in COLUMNS if name not in ("direction", "branch"))
VALUES: Columns = {
    "reason": Column(
        "reason for which the value was evaluated",
        "scan; seed: with another seed than the scan; orbit: on a branch; beside a special point; bisection; extended: "
        "with twice the settling time; beyond a mixed interval or a jump",
        kind=TEXT,
    ),
    "seed": Column(
        "seed of the initial perturbation",
        "run.seed; seed and beyond: others, each for one start only",
        kind=COUNT,
    ),
    **{name: SWEEP[name] for name in (*POINT_COLUMNS, *SHEET)},
}


#: The tables of a search: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "thresholds": ("`vibroplat find`: one row per threshold.", THRESHOLDS),
    "scan": (
        "`vibroplat find`: one row per evaluated value.",
        {"…": Column("value of the key, under its dotted name"), **VALUES, **point_columns(), **CONVEYING},
    ),
}
