"""The data sheet of runs on the page: what an engineer asks for, by its groups, a row for each quantity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from vibroplat.config.digits import NEGLIGIBLE, number, quantity, share, spread
from vibroplat.config.scene import Scene
from vibroplat.page.tables import hint
from vibroplat.results.answer import are_alike
from vibroplat.results.picture import NOT_SYNCHRONOUS
from vibroplat.results.run_answer import (
    SETTLED,
    peak_time,
    phase_text,
    speeds_of_both,
    static_and_dynamic,
    sync_text,
    transient,
)

#: Headings of the columns of a single run.
HEADS = ("", "{}", "largest, with start", "when")


class Row(NamedTuple):
    """A row of a data sheet.

    Attributes
    ----------
    label
        What it is.
    now, also
        Value in operation, and what is said beside it.
    most, when
        Largest value of the whole run, and when that was.
    """

    label: str
    now: str = ""
    also: str = ""
    most: str = ""
    when: str = ""


class Sheet:
    """Writes the data sheet of a run.

    Parameters
    ----------
    summary, scene
        Its summary, and what was simulated.
    steady
        When its stroke was steady (s), if that is known.

    Attributes
    ----------
    groups
        Rows by the names of groups; rows and groups without a number are left out.
    now
        What was measured: the motion in operation, or a transient.
    """

    def __init__(self, summary: Mapping[str, Any], scene: Scene, steady: float | None = None) -> None:
        self.summary, self.scene, self.steady = summary, scene, steady
        self.groups: dict[str, list[Row]] = {}
        self.now = "in operation"
        if summary.get("rms_y_m") is None:
            return
        self.now = transient(scene, summary) or self.now
        groups = {
            "Amplitude and stroke": self._strokes(),
            "Force into the foundation": self._loads(),
            "Motors, each or 1 / 2": self._motors(),
            "Bearings, each or 1 / 2": [self._pair_row("centrifugal force", "bearing_force_{}_max_n", "N")],
            "Synchronization": self._synchronization(),
            "Material": self._material(),
            "Balances": self._balances(),
        }
        known = {name: [row for row in rows if any(row[1:])] for name, rows in groups.items()}
        self.groups = {name: rows for name, rows in known.items() if rows}

    # -- parts of rows ------------------------------------------------------------------------------

    def _get(self, key: str, unit: str = "", **how: Any) -> str:
        """Write a number of the summary as :func:`quantity` does; "" if there is none."""
        value = self.summary.get(key)
        return "" if value is None else quantity(value, unit, **how)

    def _row(self, label: str, column: str, unit: str, *, largest: float | None = None, sign: str = "") -> Row:
        """Return the row of a column; beside ``largest`` what is small is 0, and was so at no time."""
        size, peak = (self._get(name, unit, largest=largest) for name in (column, f"whole_{column}"))
        signed = f"{sign}{size}" if size not in ("", "0") else size
        return Row(label, signed, "", peak, peak_time(self.summary, column) if peak not in ("", "0") else "")

    def _pair(self, column: str, unit: str = "") -> str:
        """Return the numbers of both motors, shares without a unit; one if they are alike."""
        values = [self.summary.get(column.format(n)) for n in (1, 2)]
        known = [value for value in values if value is not None]
        size = max(map(abs, known), default=0.0)
        if known[1:] and are_alike(known):
            values = known[:1]
        texts = [quantity(one, unit, digits=3, size=size, largest=size) if unit else share(one) for one in values]
        *others, last = dict.fromkeys(texts)
        return " / ".join([*(one.removesuffix(f" {last.rpartition(' ')[2]}") for one in others), last] * bool(known))

    def _pair_row(self, label: str, column: str, unit: str, most: str = "") -> Row:
        """Return the row of both motors, with the larger of their largest values."""
        names = [(most or column).format(n) for n in (1, 2)]
        name = max(names, key=lambda one: self.summary.get(f"whole_{one}") or 0.0)
        return self._row(label, name, unit)._replace(now=self._pair(column, unit))

    # -- groups -------------------------------------------------------------------------------------

    def _strokes(self) -> list[Row]:
        s, arm = self.summary, self.scene.body.distance
        largest = max(s.get(f"stroke_{axis}_m") or 0.0 for axis in "xy")
        axis = "x" if s["rms_x_m"] > s["rms_y_m"] else "y"
        still = NEGLIGIBLE * s[f"rms_{axis}_m"] / arm if arm else None
        turned, most = (self._get(key, "rad", error=still) for key in ("rms_phi_rad", "phi_max_rad"))
        return [
            *(self._row(f"stroke {one}", f"stroke_{one}_m", "m", largest=largest) for one in "yx"),
            *(self._point(name, largest) for name in self.scene.output.points),
            Row(f"amplitude {axis}", self._get(f"amplitude_{axis}_m", "m"), f"RMS {self._get(f'rms_{axis}_m', 'm')}"),
            Row("rotation", turned, "RMS" if turned not in ("", "0") else "", most),
            self._acceleration("acceleration", "acceleration_max_m_per_s2"),
            Row("throw index", self._get("gamma"), "", self._get("whole_gamma")),
        ]

    def _point(self, name: str, largest: float) -> Row:
        """Return the motion of a named point in one row."""
        y, x = (self._row(f"stroke y at {name}", f"stroke_{axis}_{name}_m", "m", largest=largest) for axis in "yx")
        acceleration = self._acceleration("", f"acceleration_max_{name}_m_per_s2").now
        return y._replace(also=", ".join(filter(None, (x.now and f"x {x.now}", acceleration))))

    def _acceleration(self, label: str, column: str) -> Row:
        gravity, row = self.scene.machine.gravity_m_per_s2, self._row(label, column, "m/s²")
        if not gravity or not row.now:
            return row
        now, most = ((self.summary.get(name) or 0.0) / gravity for name in (column, f"whole_{column}"))
        return Row(label, f"{number(now)} g", row.now, f"{number(most)} g" if row.most else "")

    def _loads(self) -> list[Row]:
        s = self.summary
        if not (both := static_and_dynamic(s)):
            return []
        largest = max(s["foundation_force_y_max_n"], s.get("whole_foundation_force_y_max_n") or 0.0)
        turning = s.get("whole_foundation_moment_max_n_m")
        return [
            self._row("y, static ± dynamic", "foundation_force_y_max_n", "N")._replace(now=both),
            self._row("x", "foundation_force_x_max_n", "N", largest=largest, sign="± "),
            self._row("moment", "foundation_moment_max_n_m", "N·m", largest=turning, sign="± "),
            *(self._spring(name) for name in self.scene.output.springs),
            Row("static sag", self._get("static_sag_m", "m")),
        ]

    def _spring(self, name: str) -> Row:
        """Return the force in each spring at a point."""
        mean, around = (self.summary[f"spring_force_{part}_{name}_n"] for part in ("mean", "amplitude"))
        row = self._row(f"each spring at {name}", f"spring_force_max_{name}_n", "N")
        return row._replace(now=spread(-mean, around, "N"))

    def _motors(self) -> list[Row]:
        if self.summary.get("motor_power_1_mean_w") is None:
            return [Row("power of both, mean", self._get("motor_power_w", "W"))]
        most = max(self.summary.get(f"whole_torque_ratio_{n}_max") or 0.0 for n in (1, 2))
        return [
            self._pair_row("power, mean", "motor_power_{}_mean_w", "W", "motor_power_{}_max_w"),
            self._pair_row("torque, mean", "motor_torque_{}_mean_n_m", "N·m", "motor_torque_{}_max_n_m"),
            Row("of breakdown torque", self._pair("torque_ratio_{}"), "", share(most) if most else ""),
            Row("slip", self._pair("slip_{}"), f"ripple {self._pair('speed_ripple_{}_hz', 'Hz')}"),
        ]

    def _synchronization(self) -> list[Row]:
        s, frequency = self.summary, self.summary.get("excitation_frequency_hz")
        if not frequency:
            return [Row("speed", "the exciters do not turn")]
        name, speeds = caption(s, self.scene).partition(":")[0], speeds_of_both(s)
        pace = Row("speed", quantity(frequency, "Hz"), quantity(60.0 * frequency, "rpm"))
        if speeds and name == NOT_SYNCHRONOUS:
            pace = Row("speeds", " / ".join(quantity(speed, "Hz", largest=max(speeds)) for speed in speeds))
        work, moved = self._get("start_energy_j", "J"), s.get("stroke_change") or 0.0
        step, steady = (
            "" if at is None else f"after {quantity(at, 's', digits=2)}" if at else "from the start"
            for at in (s.get("synchronized_at_s"), self.steady)
        )
        return [
            Row("phase difference", phase_text(s) or "drifts", name),
            pace,
            Row("in step", step, *((work, "work until then") if step and s.get("start_energy_j") else ())),
            Row("stroke steady", steady, "within 1 %" if steady else ""),
            Row(
                "motion repeats",
                repeats(s.get("period")),
                f"strokes change by {share(moved)}" if moved > SETTLED else "",
            ),
        ]

    def _material(self) -> list[Row]:
        s = self.summary
        if not self.scene.has_contact:
            return []
        impacts, flies = s.get("impacts_per_period"), s.get("flight_fraction")
        rate = "" if impacts is None else quantity(impacts) if impacts % 1 else str(int(impacts))
        gap, impulse = self._get("gap_max_m", "m"), self._get("impulse_max_n_s", "N·s")
        return [
            Row("in flight", share(flies), f"gap {gap}" if flies else ""),
            Row("impacts a turn", rate, f"impulse {impulse}" if impacts else ""),
            Row("contact force, largest", self._get("contact_force_max_n", "N")),
        ]

    def _balances(self) -> list[Row]:
        names = {"energy, residual": "energy_residual", "momentum y, residual": "momentum_residual"}
        known = {label: self.summary.get(name) for label, name in names.items()}
        return [Row(label, share(value)) for label, value in known.items() if value is not None]


def repeats(period: int | None) -> str:
    """Say after how many turns a motion repeats."""
    if period is None:
        return ""
    return {0: "not in the turns measured", 1: "every turn"}.get(period, f"every {period} turns")


def caption(summary: Mapping[str, Any], scene: Scene) -> str:
    """Return what a machine does, in a few words."""
    if not summary.get("excitation_frequency_hz"):
        return "the exciters do not turn"
    name = sync_text(scene, summary)
    return NOT_SYNCHRONOUS if name == "none" else name


# -- as HTML -----------------------------------------------------------------------------------------------------------


def sheet_html(sheets: Sequence[Sheet], names: Sequence[str]) -> str:
    """Return the data sheet of one run, or of several with a column for each."""
    if not any(one.groups for one in sheets):
        return ""
    single = len(sheets) == 1
    heads = [head.format(sheets[0].now) for head in HEADS] if single else ["", *names]
    groups = ""
    for name in dict.fromkeys(name for one in sheets for name in one.groups):
        found = [{row.label: row for row in one.groups.get(name, [])} for one in sheets]
        labels = dict.fromkeys(label for rows in found for label in rows)
        lines = "".join(_line(label, [rows.get(label, Row(label)) for rows in found]) for label in labels)
        title = f'<tr class="group"><th scope="rowgroup" colspan="{len(heads)}">{escape(name)}</th></tr>'
        groups += f"<tbody>{title}{lines}</tbody>"
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    more = "" if single else hint("Pale: the largest value of the whole run, with its start.")
    return f'<table class="sheet{"" if single else " several"}"><thead><tr>{head}</tr></thead>{groups}</table>{more}'


def _line(label: str, rows: Sequence[Row]) -> str:
    """Return a line: of a single run with what was largest and when, of several their values beside each other."""
    cells = []
    for row in rows:
        cells.append(f"<b>{escape(row.now)}</b>" + (f" <small>{escape(row.also)}</small>" if row.also else ""))
        if len(rows) == 1:
            cells += [escape(row.most), escape(row.when)]
        elif row.most:
            cells[-1] += f' <small class="most">{escape(row.most)}</small>'
    return f'<tr><th scope="row">{escape(label)}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
