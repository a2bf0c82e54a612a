"""The data sheet of runs on the page: what an engineer asks for, by its groups, a row for each quantity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from html import escape
from typing import Any, NamedTuple

from vibroplat.columns import split
from vibroplat.config.digits import MISSING, NEGLIGIBLE, number, quantity, share, spread
from vibroplat.config.scene import Scene
from vibroplat.results.run_answer import phase_text, speeds_of_both, sync_text

#: Part of the larger one up to which two motors, or exciters, have one number.
ALIKE = 0.01
#: Headings of the columns of a single run.
HEADS = ("", "in operation", "largest, with start", "when")


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


def told(value: float | None, unit: str = "", **how: Any) -> str:
    """Write a number as :func:`quantity` does; "" if there is none."""
    return "" if value is None else quantity(value, unit, **how)


@dataclass
class Sheet:
    """Writes the data sheet of a run.

    Attributes
    ----------
    summary, scene
        Its summary, and what was simulated.
    steady
        When its stroke was steady (s), if that is known.
    """

    summary: Mapping[str, Any]
    scene: Scene
    steady: float | None = None
    groups: dict[str, list[Row]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.summary.get("rms_y_m") is not None:
            self.groups = {
                "Amplitude and stroke": self._strokes(),
                "Force into the foundation": self._loads(),
                "Motors, each or 1 / 2": self._motors(),
                "Bearings, each or 1 / 2": self._bearings(),
                "Synchronization": self._synchronization(),
                "Material": self._material() if self.scene.has_contact else [],
                "Balances": self._balances(),
            }
        self.groups = {
            name: kept for name, rows in self.groups.items() if (kept := [r for r in rows if r[1:] != ("",) * 4])
        }

    # -- parts of rows ------------------------------------------------------------------------------

    def _get(self, key: str) -> Any:
        return self.summary.get(key)

    def _when(self, column: str) -> str:
        base = split(column)[0]
        at, pace = (self._get(f"whole_{base}_at_{end}") for end in ("s", "hz"))
        if at is None:
            return ""
        return ", ".join(filter(None, (quantity(at, "s") if at else "0 s", told(pace, "Hz", digits=3))))

    def _row(self, label: str, column: str, unit: str, *, largest: float | None = None, sign: str = "") -> Row:
        """Return the row of a column; beside ``largest`` what is small is 0, and was so at no time."""
        now, most = self._get(column), self._get(f"whole_{column}")
        size, peak = (told(value, unit, largest=largest) for value in (now, most))
        signed = f"{sign}{size}" if size not in ("", "0") else size
        return Row(label, signed, "", peak, self._when(column) if peak and peak != "0" else "")

    def _pair(self, column: str, unit: str, write: Any = quantity) -> str:
        """Return the numbers of both motors, one if they are alike."""
        first, second = (self._get(column.format(n)) for n in (1, 2))
        if first is None or second is None:
            known = [MISSING if value is None else write(value, unit) for value in (first, second)]
            return "" if first is second else " / ".join(known)
        size = max(abs(first), abs(second))
        if abs(first - second) <= ALIKE * size:
            return str(write(first, unit))
        one, other = (write(value, unit, size=size, largest=size) for value in (first, second))
        return one if one == other else f"{one.removesuffix(' ' + other.rpartition(' ')[2])} / {other}"

    def _pair_row(self, label: str, column: str, unit: str, most: str = "") -> Row:
        peaks = [(self._get(f"whole_{most.format(n)}"), most.format(n)) for n in (1, 2)]
        known = [(value, name) for value, name in peaks if value is not None] if most else []
        value, name = max(known, default=(None, ""))
        return Row(label, self._pair(column, unit), "", told(value, unit), "" if value is None else self._when(name))

    # -- groups -------------------------------------------------------------------------------------

    def _strokes(self) -> list[Row]:
        s, arm = self.summary, self.scene.body.distance
        largest = max(s.get(f"stroke_{axis}_m") or 0.0 for axis in "xy")
        rows = [self._row(f"stroke {axis}", f"stroke_{axis}_m", "m", largest=largest) for axis in "yx"]
        rows += [self._point(name, largest) for name in self.scene.output.points]
        axis = "x" if s["rms_x_m"] > s["rms_y_m"] else "y"
        rms, amplitude = told(s[f"rms_{axis}_m"], "m"), told(s.get(f"amplitude_{axis}_m"), "m")
        rows.append(Row(f"amplitude {axis}", amplitude, f"RMS {rms}") if amplitude else Row(f"RMS {axis}", rms))
        still = NEGLIGIBLE * s[f"rms_{axis}_m"] / arm if arm else None
        turned, most = (told(s.get(key), "rad", error=still) for key in ("rms_phi_rad", "phi_max_rad"))
        rows.append(Row("rotation", turned, "RMS" if turned not in ("", "0") else "", most))
        rows.append(self._acceleration("acceleration", "acceleration_max_m_per_s2"))
        return [*rows, Row("throw index", told(s.get("gamma")), "", told(s.get("whole_gamma")))]

    def _point(self, name: str, largest: float) -> Row:
        """Return the motion of a named point in one row."""
        y, x = (self._row(f"stroke y at {name}", f"stroke_{axis}_{name}_m", "m", largest=largest) for axis in "yx")
        acceleration = self._acceleration("", f"acceleration_max_{name}_m_per_s2").now
        return y._replace(also=", ".join(filter(None, (x.now and f"x {x.now}", acceleration))))

    def _acceleration(self, label: str, column: str) -> Row:
        gravity, row = self.scene.machine.gravity_m_per_s2, self._row(label, column, "m/s²")
        if not gravity or not row.now:
            return row
        now, most = ((self._get(name) or 0.0) / gravity for name in (column, f"whole_{column}"))
        return Row(label, f"{number(now)} g", row.now, f"{number(most)} g" if row.most else "")

    def _loads(self) -> list[Row]:
        s = self.summary
        mean, most = s.get("foundation_force_y_mean_n"), s.get("foundation_force_y_max_n")
        if mean is None or most is None:
            return []
        around = s.get("foundation_force_y_amplitude_n")
        around = max(most - abs(mean), 0.0) if around is None else around
        upright = self._row("y, static ± dynamic", "foundation_force_y_max_n", "N")
        largest = max(most, s.get("whole_foundation_force_y_max_n") or 0.0)
        turning = s.get("whole_foundation_moment_max_n_m")
        return [
            upright._replace(now=spread(-mean, around, "N")),
            self._row("x", "foundation_force_x_max_n", "N", largest=largest, sign="± "),
            self._row("moment", "foundation_moment_max_n_m", "N·m", largest=turning, sign="± "),
            *(self._spring(name) for name in self.scene.output.springs),
            Row("static sag", told(s.get("static_sag_m"), "m")),
        ]

    def _spring(self, name: str) -> Row:
        """Return the force in each spring at a point."""
        column = f"spring_force_max_{name}_n"
        mean, around = (self._get(f"spring_force_{part}_{name}_n") for part in ("mean", "amplitude"))
        now = spread(-mean, around, "N") if mean is not None and around is not None else ""
        return self._row(f"each spring at {name}", column, "N")._replace(now=now)

    def _motors(self) -> list[Row]:
        if self._get("motor_power_1_mean_w") is None:
            return [Row("power of both, mean", told(self._get("motor_power_w"), "W"))]
        most = [value for n in (1, 2) if (value := self._get(f"whole_torque_ratio_{n}_max")) is not None]
        ripple = self._pair("speed_ripple_{}_hz", "Hz", partial(quantity, digits=3))
        return [
            self._pair_row("power, mean", "motor_power_{}_mean_w", "W", "motor_power_{}_max_w"),
            self._pair_row("torque, mean", "motor_torque_{}_mean_n_m", "N·m", "motor_torque_{}_max_n_m"),
            Row("of breakdown torque", self._pair("torque_ratio_{}", "", _share), "", share(max(most)) if most else ""),
            Row("slip", self._pair("slip_{}", "", _share), f"ripple {ripple}"),
        ]

    def _bearings(self) -> list[Row]:
        return [self._pair_row("centrifugal force", "bearing_force_{}_max_n", "N", "bearing_force_{}_max_n")]

    def _synchronization(self) -> list[Row]:
        s, frequency = self.summary, self._get("excitation_frequency_hz")
        if not frequency:
            return [Row("speed", "the exciters do not turn")]
        name = sync_text(self.scene, s).partition(":")[0]
        speeds = speeds_of_both(s) if name == "none" else None
        rows = [
            Row("phase difference", phase_text(s) or "drifts", "not synchronous" if name == "none" else name),
            Row("speeds", " / ".join(told(speed, "Hz") for speed in speeds))
            if speeds
            else Row("speed", told(frequency, "Hz"), told(60.0 * frequency, "rpm")),
        ]
        work = s.get("start_energy_j") or None
        when = {"in step": s.get("synchronized_at_s"), "stroke steady": self.steady}
        more = {"in step": ("", told(work, "J"), "work until then" if work else ""), "stroke steady": ("within 1 %",)}
        for label, at in when.items():
            if at is not None:
                rows.append(
                    Row(label, f"after {quantity(at, 's', digits=2)}" if at else "from the start", *more[label])
                )
        return [*rows, Row("motion repeats", repeats(s.get("period")))]

    def _material(self) -> list[Row]:
        s, flies = self.summary, bool(self._get("flight_fraction"))
        impacts, gap, impulse = (s.get(key) for key in ("impacts_per_period", "gap_max_m", "impulse_max_n_s"))
        rate = told(impacts) if impacts is None or impacts % 1 else str(int(impacts))
        return [
            Row("in flight", share(s.get("flight_fraction")), f"gap {told(gap, 'm')}" if flies and gap else ""),
            Row("impacts a turn", rate, f"impulse {told(impulse, 'N·s')}" if impulse else ""),
            Row("contact force, largest", told(s.get("contact_force_max_n"), "N")),
        ]

    def _balances(self) -> list[Row]:
        names = {"energy, residual": "energy_residual", "momentum y, residual": "momentum_residual"}
        return [Row(label, share(self._get(key))) for label, key in names.items() if self._get(key) is not None]


def _share(value: float | None, _: str, **__: Any) -> str:
    """Write a share as :func:`quantity` writes numbers."""
    return share(value)


def repeats(period: int | None) -> str:
    """Say after how many turns a motion repeats."""
    if period is None:
        return ""
    return {0: "not in the turns measured", 1: "every turn"}.get(period, f"every {period} turns")


def caption(summary: Mapping[str, Any], scene: Scene) -> str:
    """Return what a machine does, in a few words."""
    if not summary.get("excitation_frequency_hz"):
        return "the exciters do not turn"
    told = sync_text(scene, summary)
    return "not synchronous" if told == "none" else told


# -- as HTML -----------------------------------------------------------------------------------------------------------


def sheet_html(sheets: Sequence[Sheet], names: Sequence[str]) -> str:
    """Return the data sheet of one run, or of several with a column for each."""
    if not any(one.groups for one in sheets):
        return ""
    single = len(sheets) == 1
    heads = HEADS if single else ("", *names)
    rows = "".join(_group(name, sheets, len(heads)) for name in dict.fromkeys(n for one in sheets for n in one.groups))
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    more = "" if single else '<p class="hint">Pale: the largest value of the whole run, with its start.</p>'
    return f'<table class="sheet{"" if single else " several"}"><thead><tr>{head}</tr></thead>{rows}</table>{more}'


def _group(name: str, sheets: Sequence[Sheet], width: int) -> str:
    """Return the rows of a group."""
    found = [{row.label: row for row in one.groups.get(name, [])} for one in sheets]
    labels = dict.fromkeys(label for rows in found for label in rows)
    body = "".join(_line(label, [rows.get(label) for rows in found]) for label in labels)
    return f'<tbody><tr class="group"><th scope="rowgroup" colspan="{width}">{escape(name)}</th></tr>{body}</tbody>'


def _line(label: str, rows: Sequence[Row | None]) -> str:
    """Return a line: of a single run with what was largest and when, of several their values beside each other."""
    cells = []
    for row in rows:
        known = row or Row(label)
        also = f" <small>{escape(known.also)}</small>" if known.also else ""
        cells.append(f"<b>{escape(known.now)}</b>{also}")
        if len(rows) == 1:
            cells += [escape(known.most), escape(known.when)]
        elif known.most:
            cells[-1] += f' <small class="most">{escape(known.most)}</small>'
    return f'<tr><th scope="row">{escape(label)}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
