"""The data sheet of a run in words: a row for each measure in an engineer's groups, for prints and for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NamedTuple

from vibroplat.columns import display_name, name_sync, split, unit_of
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import NEGLIGIBLE, given, interval, number, percent, quantity, spread, together
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes
from vibroplat.observe.section import MAX_PERIOD
from vibroplat.report.data_sheet import columns
from vibroplat.report.summary import synchronization
from vibroplat.results.answer import LABEL, Numbers, are_alike, counted, of_both, short_line
from vibroplat.results.run_answer import (
    SETTLED,
    limit_text,
    phase_text,
    repetition_text,
    speeds_of_both,
    transient,
    without_round_off,
)

#: Minimum rotation, as a stroke at the exciters' distance relative to the largest stroke, to be in the short print.
MIN_ROTATION = 0.1
#: Most named points and springs in the short print.
MAX_POINTS = 4
#: Parts of the names of columns whose values are printed in per cent.
SHARES = {"ratio", "slip", "residual", "fraction"}
#: Measures of conveyed material by their names, with the ends of their columns.
_CONVEYED = (
    *(("throughput", "kg_per_s"), ("residence time", "s"), ("friction power", "w")),
    *(("wear power", "w_per_m2"), ("friction work", "j")),
)
#: What a time has that counts from when motors were switched.
AFTER = " after "
#: Groups of rows: what was measured at named points, and numbers that no other row has.
POINTS, FURTHER = "Points and springs", "Further numbers"


class Row(NamedTuple):
    """A measure of a data sheet.

    Attributes
    ----------
    label
        What it is.
    now, also
        Value in the measuring interval, and a remark.
    most, when
        Largest value of the whole run, and when that was.
    short
        Label, value and further words in the short print; empty if it is not there.
    column
        Column of the value, of rows that have one value.
    """

    label: str
    now: str = ""
    also: str = ""
    most: str = ""
    when: str = ""
    short: tuple[str, ...] = ()
    column: str = ""

    @property
    def peak(self) -> str:
        """The largest value of the whole run, its time and speed, as far as they are known and not 0."""
        when = self.when if AFTER in self.when else f"at {self.when}" * bool(self.when)
        return f"largest {self.most} {when}".rstrip() if self.most not in ("", "0") else ""

    def shortly(self, label: str, *words: str) -> Row:
        """Return the row with a line in the short print."""
        return self._replace(short=(label, self.now, _join(*words)))


class Sheet:
    """Tells the data sheet of a run.

    Parameters
    ----------
    scene, summary
        What was simulated, and its summary.
    steady
        When its stroke was steady (s), if that is known.

    Attributes
    ----------
    transient
        Description of the measuring interval if the operation is not steady.
    groups
        Rows by the names of groups; rows and groups without a value are left out.
    """

    def __init__(self, scene: Scene, summary: Mapping[str, Any], steady: float | None = None) -> None:
        self.scene, self.steady, self.numbers = scene, steady, Numbers(without_round_off(scene, summary))
        self.groups: dict[str, list[Row]] = {}
        self.transient = ""
        if self.numbers["rms_y_m"] is None:
            return
        self.transient = transient(scene, summary)
        balances = ("energy_residual", "momentum_residual", "momentum_along_residual")
        groups = {
            "Amplitude and stroke": self._strokes(),
            "Conveying": self._conveying() if scene.transport is not None else [],
            "Force into the foundation": self._loads(),
            "Motors (each, or 1 / 2)": self._motors(),
            "Bearings (each, or 1 / 2)": self._bearings(),
            "Synchronization": self._synchronization(),
            POINTS: [*map(self._point, scene.output.points), *map(self._spring, scene.measured_springs)],
            "Material": self._material() if scene.has_contact else [],
            "Balances": [Row(display_name(name), self._text(name)) for name in balances],
        }
        left = [name for name in columns(scene) if name not in self.numbers.read]
        groups[FURTHER] = [Row(display_name(name), self._text(name, largest=self._largest(name))) for name in left]
        known = {name: [row for row in rows if any(row[1:5])] for name, rows in groups.items()}
        self.groups = {name: rows for name, rows in known.items() if rows}

    def short_rows(self) -> list[Row]:
        """Return the rows of the short print; none if forces or strokes are not known."""
        if self.numbers["foundation_force_y_rms_n"] is None or self.numbers["stroke_y_m"] is None:
            return []
        groups = [rows[: MAX_POINTS if name == POINTS else None] for name, rows in self.groups.items()]
        return [row for rows in groups for row in rows if row.short and row.now]

    def short(self) -> Iterator[tuple[str, ...]]:
        """Yield labels, values and further words of the short print; none if forces or strokes are not known."""
        s, rows = self.numbers, self.short_rows()
        if not rows:
            return
        if self.transient:
            window = interval(s["measured_from_s"], s["measured_to_s"], "s")
            yield "no steady motion", window, f"values of this time, {self.transient}"
        of_seeds = s.get("peaks_of_seeds")
        yield from (row.short for row in rows)
        if of_seeds:
            count, captured = of_seeds["seeds"], of_seeds.get("captured")
            ends = f"at least {captured} are captured" if captured else "times refer to run 1"
            text = f"run {count + 1} is larger with probability {percent(1.0 / (count + 1))}; {ends}"
            yield "largest values", f"of {counted(count, 'run')}", text if count > 1 else "run.perturbation is 0"

    def facts(self) -> Iterator[str]:
        """Yield labels and values of the short print; while nothing is steady, with the largest values of the run."""
        for label, value, *more in self.short():
            most = next((part for part in more[0].split("; ") if self.transient and part.startswith("largest ")), "")
            yield _join(f"{label.replace(',', '')} {value}", most).replace("; ", ", ")

    # -- parts of rows ------------------------------------------------------------------------------

    def _text(self, column: str, **how: Any) -> str:
        """Write a number as :func:`quantity` does, a share in per cent; "" if there is none."""
        value = self.numbers[column]
        if value is None:
            return ""
        return percent(value) if SHARES & {*column.split("_")} else quantity(value, unit_of(column), **how)

    def _largest(self, column: str) -> float:
        """Return the largest size of the numbers with the unit of a column whose names begin as its own does."""
        begin, unit = column.partition("_")[0], unit_of(column)
        alike = [name for name in columns(self.scene) if name.startswith(begin) and unit_of(name) == unit]
        return max(abs(float(self.numbers.get(f"{part}{name}") or 0.0)) for name in alike for part in ("", "whole_"))

    def _peak(self, column: str, largest: float | None = None) -> tuple[str, str]:
        """Return the largest value of the whole run, and its time with the speed then."""
        most, base = self._text(f"whole_{column}", largest=largest), f"whole_{split(column)[0]}_at"
        of_seeds = (self.numbers.get("peaks_of_seeds") or {}).get(f"whole_{column}")
        if of_seeds and of_seeds[1] > NEGLIGIBLE * (largest or 0.0):
            most = interval(of_seeds[0], of_seeds[1], unit_of(column))
        at, pace = (self.numbers[f"{base}_{end}"] for end in ("s", "hz"))
        if at is None or most in ("", "0"):
            return most, ""
        # with a motor off, exciters may have other speeds than their mean, or swing
        known = pace and all(all(supply.driven) for supply in self.scene.drive.intervals)
        when = self._since(at) or (quantity(at, "s") if at else "0 s")
        when += " in the start" * (AFTER not in when and self._since(self.numbers["measured_to_s"]) != "")
        return most, when + (f", {quantity(pace, 'Hz', digits=3)}" if known else "")

    def _since(self, time: float) -> str:
        """Say how long after the last switch of motors a time (s) is; "" if there was none."""
        switch = self.scene.drive.last_switch(self.numbers.get("begins_s") or 0.0, time)
        if switch is None:
            return ""
        later = time - switch[0]
        return f"{quantity(later, 's') if later else '0 s'}{AFTER}{switch[1]}"

    def _row(self, label: str, column: str, largest: float | None = None, error: float = 0.0) -> Row:
        """Return the row of a column, whose value is so uncertain.

        A value that is negligible relative to ``largest`` is 0 and has no time.
        """
        error = min(error, 0.5 * (self.numbers[column] or 0.0))
        return Row(
            label, self._text(column, largest=largest, error=error), "", *self._peak(column, largest), column=column
        )

    @cached_property
    def _left(self) -> tuple[float, float]:
        """How much of the strokes along x and y is a transient (m)."""
        return self.numbers["transient_x_m"] or 0.0, self.numbers["transient_y_m"] or 0.0

    def _pair(self, column: str) -> str:
        """Return the numbers of both motors, shares without a unit; one if they are alike."""
        values = [self.numbers[column.format(n)] for n in (1, 2)]
        if values == [None, None] or (None not in values and are_alike(values)):
            return self._text(column.format(1))
        if unit_of(column):
            return together(values, unit_of(column), " / ")
        return " / ".join(dict.fromkeys(map(percent, values)))

    def _pair_row(self, label: str, column: str, most: str) -> Row:
        """Return the row of both motors, with the larger of their largest values."""
        larger = max((1, 2), key=lambda n: self.numbers[f"whole_{most.format(n)}"] or 0.0)
        return Row(label, self._pair(column), "", *self._peak(most.format(larger)))

    def _force(self, label: str, name: str, static: float, error: float = 0.0, largest: float | None = None) -> Row:
        """Return the row of a force: static and dynamic part, or its maximum if it has only one of them.

        ``error`` is how much of the dynamic part decays; values that are negligible relative to ``largest`` are 0.
        """
        row, varies = self._row(label, name.format("max"), largest, error), self.numbers[name.format("amplitude")]
        if varies is None or not static:
            return row
        what = "static ± dynamic" if varies > NEGLIGIBLE * abs(static) else "static"
        return row._replace(label=f"{label}, {what}", now=spread(static, varies, "N", min(error, 0.5 * varies)))

    # -- groups -------------------------------------------------------------------------------------

    def _strokes(self) -> list[Row]:
        s, arm = self.numbers, self.scene.body.distance
        strokes = {axis: s[f"stroke_{axis}_m"] or 0.0 for axis in "xy"}
        main = max(strokes, key=lambda axis: strokes[axis])
        other, largest = "xy".replace(main, ""), strokes[main]
        left = dict(zip("xy", self._left, strict=True))
        rows = {axis: self._row(f"stroke {axis}", f"stroke_{axis}_m", largest, left[axis]) for axis in "yx"}
        decays = limit_text(largest, left[main], natural_modes(self.scene).damping["xy".index(main)] > 0.0)
        rows[main] = rows[main]._replace(also=decays)
        words = [f"{other} {rows[other].now}", self._largest_stroke(main, rows)]
        rows[main] = rows[main].shortly(f"stroke {main}", decays, *(words[::-1] if decays else words))
        rms = [s["rms_x_m"], s["rms_y_m"]]
        still = NEGLIGIBLE * max(rms) / arm if arm else None
        turned, most = (self._text(key, error=still) for key in ("rms_phi_rad", "phi_max_rad"))
        rotation = Row("rotation", turned, "RMS of phi" * (turned != "0"), most, column="rms_phi_rad")
        rocks = s["rms_phi_rad"] * arm * 2.0 * math.sqrt(2.0) > MIN_ROTATION * largest
        acceleration = self._row("acceleration", "acceleration_max_m_per_s2")
        floats = not self.scene.machine.gravity_m_per_s2
        return [
            *rows.values(),
            Row("RMS x, y", together(rms, "m")),
            rotation.shortly("rotation", "RMS of phi") if rocks else rotation,
            acceleration.shortly("acceleration", self._flight()) if floats else acceleration,
            self._row("throw index", "gamma").shortly("throw index", self._flight()),
        ]

    def _largest_stroke(self, main: str, rows: Mapping[str, Row]) -> str:
        """Return the larger peak of both axes, with its axis where that is not the main one."""
        ranges = self.numbers.get("peaks_of_seeds") or {}
        names = {axis: f"whole_stroke_{axis}_m" for axis in "xy"}
        sizes = {axis: ranges.get(name, [self.numbers[name] or 0.0])[-1] for axis, name in names.items()}
        top = max(main, *"xy", key=lambda axis: sizes[axis])
        return rows[top].peak.replace("largest", "largest" if top == main else f"largest {top}", 1)

    def _flight(self) -> str:
        """Return the flight of the material in words."""
        flies, impacts = self.numbers["flight_fraction"], self.numbers["impacts_per_period"]
        if not self.scene.has_contact:
            return "material that cannot lift off" if self.scene.material_mass else "no material"
        if not flies:
            return "material does not lift off"
        text = f"material in flight {percent(flies)}"
        if impacts is None:
            return text
        rate = number(impacts).removesuffix(".00")
        return f"{text}, {rate} impact{'s' * (rate != '1')} a turn"

    def _conveying(self) -> list[Row]:
        """Return the rows of material that moves along the deck."""
        s = self.numbers
        sticks, forth, back = (self._text(f"{name}_fraction") for name in ("stick", "slip_plus", "slip_minus"))
        slips = percent((s["slip_plus_fraction"] or 0.0) + (s["slip_minus_fraction"] or 0.0))
        swing = TURN * (s["excitation_frequency_hz"] or 0.0) * max(s["rms_x_m"], s["rms_y_m"])
        largest = max(swing, abs(s["conveying_speed_m_per_s"] or 0.0))
        speed, error = (self._text(f"conveying_speed_{what}m_per_s", largest=largest) for what in ("", "error_"))
        rows = [Row(name, self._text(f"{name.replace(' ', '_')}_{unit}")) for name, unit in _CONVEYED]
        assert self.scene.transport is not None
        runs_away = self.scene.transport.runs_away and not s.get("period")
        rows = rows[2:] if runs_away or speed == "0" else rows
        carried = rows[0].now if rows[0].label == "throughput" else "in this time, it runs away" * runs_away
        modes, sheared = f"sticks {sticks}, slips {slips} of the time", self._text("sheared_fraction")
        also = f"± {error}" * (error not in ("", "0") and speed != "0")
        row = Row("conveying speed", speed, also, column="conveying_speed_m_per_s")
        return [
            row.shortly("conveying speed", row.also, carried, "" if runs_away else modes),
            *rows,
            Row("sticks", sticks, f"slips {forth} towards +x, {back} towards −x"),
            Row("beyond internal friction", sheared, "of the contact time" * bool(sheared)),
        ]

    def _loads(self) -> list[Row]:
        scene, stiffness = self.scene, self.scene.oscillators[2].tolist()
        weight = [(scene.platform_mass + sum(scene.layer_masses)) * part for part in scene.gravity]
        names = [f"foundation_force_{axis}_{{}}_n" for axis in "xy"]
        labels = ("x along the deck", "y normal to the deck") if weight[0] else ("x", "y")
        largest = max(self.numbers[name.format("amplitude")] or 0.0 for name in names)
        x, y = (
            self._force(labels[i], names[i], weight[i], 0.5 * stiffness[i] * self._left[i], largest) for i in (0, 1)
        )
        across = x.label.partition(", ")[0].removeprefix("x ") if weight[0] else ""
        turning = self.numbers["whole_foundation_moment_max_n_m"]
        return [
            y.shortly("foundation, y", y.label.partition(", ")[2], y.peak),
            x.shortly("foundation, x", across, x.peak) if x.now != "0" or x.peak else x,
            self._row("moment", "foundation_moment_max_n_m", turning),
            Row("static sag", self._text("static_sag_m")),
        ]

    def _motors(self) -> list[Row]:
        powers = self._pair_row("power, mean", "motor_power_{}_mean_w", "motor_power_{}_max_w")
        ripple = self._pair("speed_ripple_{}_hz")
        return [
            powers._replace(short=self._driven()),
            self._pair_row("torque, mean", "motor_torque_{}_mean_n_m", "motor_torque_{}_max_n_m"),
            self._pair_row("of critical torque", "torque_ratio_{}", "torque_ratio_{}_max"),
            Row("slip", self._pair("slip_{}"), f"ripple {ripple}" * bool(ripple)),
        ]

    def _driven(self) -> tuple[str, ...]:
        """Return the short line of the motors that are on."""
        s = self.numbers
        measured = s["measured_from_s"], s["measured_to_s"]
        driven = [n for n, is_on in enumerate(self.scene.driven(*measured), 1) if is_on]
        if self.scene.braked(*measured) and s["measured_turns"]:
            driven = [1, 2]
        powers, slips, ratios = (
            [value for n in driven if (value := s[name.format(n)]) is not None]
            for name in ("motor_power_{}_mean_w", "slip_{}", "torque_ratio_{}")
        )
        if not powers:
            return ()
        words = [of_both(powers, "W") if powers[1:] else f"motor {driven[0]}"]
        words += [f"slip {percent(max(slips, key=abs))}"] if slips else []
        plates = [self.scene.exciter_pair[n - 1].breakdown_ratio for n in driven]
        loads = [ratio * plate for ratio, plate in zip(ratios, plates, strict=False) if plate]
        words += (
            [f"{percent(max(loads or ratios, key=abs))} of {'rated' if loads else 'critical'} torque"] if ratios else []
        )
        return "motor power", quantity(sum(powers), "W"), _join(*words)

    def _bearings(self) -> list[Row]:
        row = self._pair_row("centrifugal force", "bearing_force_{}_max_n", "bearing_force_{}_max_n")
        whose = "of exciters 1 and 2" if " / " in row.now else "each exciter"
        return [
            row._replace(short=("bearing force", row.now.replace(" / ", " and "), f"{whose}, largest centrifugal one"))
        ]

    def _synchronization(self) -> list[Row]:
        s, frequency = self.numbers, self.numbers["excitation_frequency_hz"]
        if not frequency:
            return [Row("speed", "the exciters do not turn")]
        if not s["measured_turns"] and not any(self.scene.driven(s["measured_from_s"], s["measured_to_s"])):
            return [Row("speed", "no whole turn", "the exciters swing or rest")]
        speeds, name = speeds_of_both(s), synchronization(s)
        pace = Row("speed", quantity(frequency, "Hz"), quantity(60.0 * frequency, "rpm"))
        if speeds and name == "none":
            pace = Row("speeds", " / ".join(quantity(speed, "Hz", largest=max(speeds)) for speed in speeds))
        at, work, moved = s["synchronized_at_s"], self._text("start_energy_j"), s["stroke_change"] or 0.0
        begins = s["begins_s"] or 0.0
        passed, steadied = (None if time is None else time - begins for time in (at, self.steady))
        since, steady = (
            "" if time is None else f"after {quantity(time, 's', digits=2)}" if time else "from the start"
            for time in (passed, steadied)
        )
        switched = self._since(at) if passed else ""
        in_step = Row("in step", switched or since, f"motor work {work}" * bool(passed and not switched))
        started = ("start", quantity(passed, "s"), f"until synchronized, {work} of motor work")
        if begins:
            started = ("in step", quantity(passed, "s"), f"after it began, {work} of motor work")
        if switched:
            seconds, after, switch = switched.partition(AFTER)
            started = ("in step again", seconds, f"{after.strip()} {switch}")
        few = repetition_text(s)
        return [
            Row("phase difference", phase_text(s) or "drifts", name_sync(name)),
            pace,
            in_step if s["captured_by"] or not passed else in_step._replace(short=started),
            Row("stroke steady", steady, "within 1 %" * bool(steady)),
            Row(
                "motion repeats",
                "undecided" if few else _repeats(s["period"]),
                f"strokes change by {percent(moved)}" if moved > SETTLED else few.removeprefix("undecided: "),
            ),
        ]

    def _point(self, name: str) -> Row:
        """Return the motion of a named point."""
        strokes = [self.numbers[f"stroke_{axis}_{name}_m"] or 0.0 for axis in "xy"]
        y, x = (self._row(f"stroke y at {name}", f"stroke_{axis}_{name}_m", max(strokes)) for axis in "yx")
        acceleration = self._text(f"acceleration_max_{name}_m_per_s2")
        y = y._replace(also=f"x {x.now}; {acceleration}")
        return y._replace(short=(f"at {name}", f"stroke y {y.now}", f"x {x.now}; acceleration {acceleration}"))

    def _spring(self, name: str) -> Row:
        """Return the force along y in each spring of a name, its sag, and the largest force along x."""
        static = -(self.numbers[f"spring_force_mean_{name}_n"] or 0.0)
        row = self._force(f"each spring at {name}", f"spring_force_{{}}_{name}_n", static)
        if self.scene.springs is not None:
            stiffness = self.scene.measured_springs[name][1].stiffness[1]
            across = self._text(f"spring_force_x_amplitude_{name}_n", largest=static)
            sag = quantity(static / stiffness, "m") if stiffness else ""
            row = row._replace(
                also="; ".join([*([f"sag {sag}"] if sag else ["off"]), *([f"x ± {across}"] if across else [])])
            )
        return row.shortly(f"spring at {name}", row.label.replace(f" spring at {name}", ""), row.also)

    def _material(self) -> list[Row]:
        s = self.numbers
        impacts, flies = s["impacts_per_period"], s["flight_fraction"]
        rate = "" if impacts is None else number(impacts).removesuffix(".00")
        gap, impulse = self._text("gap_max_m"), self._text("impulse_max_n_s")
        return [
            Row("in flight", percent(flies), f"gap {gap}" if flies else ""),
            Row("impacts a turn", rate, f"impulse {impulse}" if impacts else ""),
            Row("contact force, largest", self._text("contact_force_max_n")),
        ]


def _repeats(period: int | None) -> str:
    """Say after how many turns a motion repeats."""
    texts = {None: "", 0: f"not yet, or not within {MAX_PERIOD} turns", 1: "every turn"}
    return texts.get(period, f"every {period} turns")


def _join(*parts: str) -> str:
    return "; ".join(filter(None, parts))


# -- prints ------------------------------------------------------------------------------------------------------------


def short_lines(sheet: Sheet) -> list[str]:
    """Return the few lines below the headline; none of a run that measured nothing."""
    left = len(sheet.groups.get(POINTS, [])) - MAX_POINTS
    more = [f"and {counted(left, 'more point')}: -v"] if left > 0 else []
    rows = [(label, value, "".join(remarks)) for label, value, *remarks in sheet.short()]
    width = max([LABEL, *(len(label) + 2 for label, *_ in rows)])  # names of points may be long
    return [*(short_line(*row, width) for row in rows), *more]


def all_lines(sheet: Sheet, origin: Mapping[str, Any] | None) -> dict[str, str]:
    """Return all numbers of a run in lines of a label and a text.

    ``origin`` is what provenance says of the run that it continues from, if any.
    """
    s, scene = sheet.numbers, sheet.scene
    counts, whole = (
        ", ".join(str(s[f"{part}{kind}"]) for kind in ("liftoffs", "impacts", "chatters")) for part in ("measured_", "")
    )
    first, last = (quantity(s[f"measured_{end}_s"], "s") for end in ("from", "to"))
    measured = f"{first} … {last}, {counted(s['measured_turns'], 'whole turn')}"
    lines = {
        "outcome": s["outcome"],
        "start": _start(scene, s, origin),
        "simulated": quantity(s["simulated_s"], "s"),
        "measured": measured if s["measured_s"] else f"nothing: the run ended before {first}",
        "liftoffs, impacts, chatters": f"{counts}; in the whole run {whole}",
        **{display_name(name): str(s[name]) for name in ("steps", "residual_calls") if s[name] is not None},
        "wall time": quantity(s["wall_s"], "s"),
    }
    for name, rows in sheet.groups.items():
        lines |= {name: ""} | {row.label: _join(", ".join(filter(None, row[1:3])), row.peak) for row in rows}
    return lines


def _start(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> str:
    """Describe how a run began."""
    size, seed = summary["perturbation"], scene.run.seed
    changed = f"rates perturbed by {given(size)} of their scales, seed {seed}" if size else "not perturbed"
    return changed if origin is None else f"where {origin['directory']} ended, {given(origin['t_s'])} s; {changed}"
