"""Mutants: faults put into the package one at a time, to see whether the tests notice.

    python tests/tools/mutants.py [--quick] [NUMBER ...]

Each mutant is a piece of the package's text, which stands there once, and what it becomes: a changed sign, factor,
comparison, default or column. The package is copied, changed and tested: first by the tests of its own room, which
notice most, then by all quick ones. A line for each says which test failed first, or that none did.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: By the folders of tests that look at them first: the text that is changed, and what it becomes.
BY_ROOM = [
    # the model
    ("model", [
        "p.damping_x * v.x + p.stiffness_x * q.x → p.damping_x * v.x - p.stiffness_x * q.x",
        "return 2.0 * torque * (critical * slip) / → return torque * (critical * slip) /",
        "response[5] = 1.0 / p.lower_mass - response[1] → response[5] = 1.0 / p.lower_mass + response[1]",
        "upper = p.upper_mass * damping[4] * squares → upper = damping[4] * squares",
        "heights - first.x - second.x → heights - first.x",
        "total(total(motor - held)) → total(total(motor))",
        # the equations, and what is written from them
        "+ total(p.deck * net + p.unbalance * turned) → + total(p.deck * net - p.unbalance * turned)",
        "ay = lifted + p.axis_x * a.phi → ay = lifted - p.axis_x * a.phi",
        "p.friction * (speed * size(speed)) → p.friction * (speed * speed)",
        "p.lower_mass * lower - p.upper_mass * hold.upper - pressed → p.lower_mass * lower + p.upper_mass * hold.upper - pressed",
        "+ twice * {self.at_zero(a)} → + {self.at_zero(a)}",
        "d[0] * x[1] + x[0] * d[1] → d[0] * x[1] - x[0] * d[1]",
        "-(n * n * d[0]) → n * n * d[0]",
    ]),
    ("model config", [
        "exciters[1].position_m or (-x, y) → exciters[1].position_m or (x, y)",
        "machine.platform_mass_kg * (x_c * x_c + y_c * y_c) → (x_c * x_c + y_c * y_c)",
    ]),
    # modes and resets
    ("hybrid motion", [
        "return force_rate >= -noise * speed → return force_rate >= noise * speed",
        "if rebound < 0.0 or acceleration >= 0.0 or p.restitution >= 1.0: → if rebound < 0.0 or p.restitution >= 1.0:",
        "speed * duration <= math.sqrt(tolerance) → speed * duration <= tolerance",
        "return ATTACH if pressed else FLY → return FLY",
        "before = min(run.state[GAP_RATE], 0.0) → before = run.state[GAP_RATE]",
        "run.zeros = 3  # gap, its rate and its acceleration\n    add_event → run.zeros = 0\n    add_event",
        "if run.restarts >= max_restarts and run.now - h.recent[oldest] < run.period: → if run.restarts >= max_restarts:",
        "0.0 if -before < h.p.sticking_speed else h.p.restitution\n    blow → h.p.restitution\n    blow",
        "if force <= run.force_error and rate < 0.0: → if force <= run.force_noise and rate < 0.0:",
        "mode = SLIP_MINUS if run.fallen == 0 else SLIP_PLUS → mode = SLIP_PLUS if run.fallen == 0 else SLIP_MINUS",
    ]),
    # integrators
    ("integrate", [
        "return greater(float(k) * largest(coordinates) → return greater(largest(coordinates)",
        "good = (worst <= greater(s.noise, MAX_DEFECT)) → good = (worst <= greater(s.noise, 1e9))",
        "stop, status.resting = AT_TARGET, -1\n            length *= crossing(c, degree, 3, target, angle) → stop, status.resting = AT_TARGET, -1",
        "s.v[3 + status.resting, lane] = 0.0 → s.v[3 + status.resting, lane] = 1e-3",
    ]),
    # what is observed
    ("observe report motion", [
        '0.5 * float(extremes["largest"][HEIGHT] - extremes["least"][HEIGHT]) → float(extremes["largest"][HEIGHT] - extremes["least"][HEIGHT])',
        '  "excitation_frequency_hz": 0.5 * (first + second) →   "excitation_frequency_hz": first',
        '"frequency_split_hz": first - second, → "frequency_split_hz": second - first,',
        "mean[square] - mean[first] ** 2 → mean[square] + mean[first] ** 2",
        "gravity = before.gravity - after.gravity → gravity = after.gravity - before.gravity",
        'max(0.0, -float(whole["least"][CONTACT_FORCE])) → max(0.0, -float(late["least"][CONTACT_FORCE]))',
        "ms.closed[marks.turns % ms.closed.size] = → ms.closed[(marks.turns + 1) % ms.closed.size] =",
        "degree, first, cut, piece.system, nodes → degree, 0.0, cut, piece.system, nodes",
    ]),
    ("observe study", [
        "total / (count - 1) / count * (1.0 + r) → total / (count - 1) * (1.0 + r)",
    ]),
    ("observe continuation", [
        "if falling and rate > 0.0: → if rate > 0.0:",
        "MOMENTUM * energy → 0.0 * energy",
    ]),
    # the configuration
    ("config", [
        "self.ramp * (time - self.start) if self.ramp → self.ramp * time if self.ramp",
        'None if switch is None else switch == "on" → None if switch is None else switch == "off"',
        "if after < before: → if after > before:",
        "if not state.gap_m and state.gap_rate_m_per_s < 0.0: → if state.gap_rate_m_per_s < 0.0:",
        "value is None or low <= value <= high → value is None or value <= high",
        "math.sqrt(stiffness / mass) / TURN → math.sqrt(stiffness / mass)",
        "half * half - stiffness → half * half + stiffness",
        "given = initial.state is not None or initial.from_ is not None → given = initial.state is not None and initial.from_ is not None",
        'Fraction = described(0.0, "R" → Fraction = described(0.5, "R"',
    ]),
    # studies
    ("study", [
        "abs(self.value) > max(3.0 * self.error, MAX_ERROR_PER_TURN / self.turn) → abs(self.value) > 3.0 * self.error",
        "same_extent and way <= max(tolerance → same_extent or way <= max(tolerance",
        "if close and was_close and not → if close and not",
        "now * ratio / (1.0 - ratio) → now * ratio",
    ]),
    ("study plots", [
        "& _isolated(np.abs(change), steps) → ",
        "jump = np.any( → jump = np.all(",
    ]),
    ("study", [
        "return None if exponent.sign > 0 else → return None if exponent.sign < 0 else",
        "now <= EXTRAPOLATION_LIMIT * tolerance → now >= EXTRAPOLATION_LIMIT * tolerance",
    ]),
    # basins and thresholds
    ("basin", [
        "stays = reached.diagonal().copy() → stays = np.ones(count, dtype=bool)",
        "points[:period]).max() < SAME_ORBIT_DISTANCE → points[:period]).max() < 10.0",
        "radii = [radius for _, radius in around if radius > 0.0] → radii = [radius for _, radius in around]",
    ]),
    ("study continuation", [
        "return _place(*starts[0], rows[key]) → return _place(*starts[-1], rows[key])",
        "number(own[key].min(), 4) if len(own) → number(own[key].max(), 4) if len(own)",
    ]),
    ("continuation", [
        "= self._root / self._scales → = np.eye(len(self._root)) / self._scales",
    ]),
    ("thresholds", [
        "not (crosses and not has_errors( → not (crosses and has_errors(",
        "BATCHES[batch] if unsure else 1 → 1",
    ]),
    ("observe", [
        "form < max(e.bound[place] * followed.before, limits.near) → form < 1.0",
        "min(stride, limits.most - followed.turns) → stride",
        'synchronization(measures) != "none" and stays_synchronized( → synchronization(measures) != "none" or stays_synchronized(',
    ]),
    # continuation
    ("continuation cli", [
        "doubling * (1.0 + one) → doubling * (2.0 + one)",
        "(1.0 - 2.0 * away * steepness) → (1.0 + 2.0 * away * steepness)",
        "abs(multipliers[j].imag) > MAX_IMAGINARY → abs(multipliers[j].imag) < MAX_IMAGINARY",
        "away > MAX_MULTIPLIER_CHANGE → away < MAX_MULTIPLIER_CHANGE",
    ]),
    # what is kept on disk
    ("faults", [
        "if form != FORMAT: → if form > FORMAT:",
        "if _is_of_code(key) and not len(self): → if _is_of_code(key):",
        "if type(schema) is not int or schema != SCHEMA: → if schema != SCHEMA:",
        "old.stat().st_mtime > LEFTOVER_AGE_S: → old.stat().st_mtime > 0.0:",
    ]),
    ("study", [
        "(BrokenExecutor, CancelledError)):\n            error → (BrokenExecutor,)):\n            error",
        "for i in {*before.coordinates} ^ {*scene.coordinates}: → for i in {*before.coordinates} - {*scene.coordinates}:",
    ]),
    # figures
    ("plots page", [
        "on_axis(name, points[name]) for name in known → points[name] for name in known",
        "len(parts) <= MOST else → len(parts) < MOST else",
        "if names.count(name) == 1 else → if names.count(name) > 1 else",
    ]),
]  # fmt: skip
#: One after the other: folders, old text, new text.
MUTANTS = [(rooms, *line.split(" → ")) for rooms, lines in BY_ROOM for line in lines]


def files() -> list[Path]:
    return sorted((ROOT / "vibroplat").rglob("*.py"))


def place(text: str) -> Path:
    """Return the one file in which a text stands once."""
    found = [file for file in files() for _ in re.findall(re.escape(text), file.read_text(encoding="utf-8"))]
    if len(found) != 1:
        raise SystemExit(f"{text!r} stands in the package {len(found)} times; it must stand there once")
    return found[0]


def tested(copy: Path, arguments: list[str]) -> str:
    """Run quick tests in a copy until one fails; its name, or nothing."""
    environment = os.environ | {"PYTHONPATH": str(copy)}
    line = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(line, cwd=copy, env=environment, capture_output=True, text=True, check=False)
    if done.returncode in (0, 5):
        return ""
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return failed[1] if failed else done.stdout[-300:]


def caught(number: int, *, quick: bool) -> str:
    """Make one mutant and return the test that notices it; empty if none does."""
    rooms, old, new = MUTANTS[number]
    file = place(old).relative_to(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("vibroplat", "tests", "configs", "results"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.parquet"))
        for name in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / name, copy / name)
        changed = copy / file
        changed.write_text(changed.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        own = [f"tests/{room}" for room in rooms.split() if (copy / "tests" / room).is_dir()]
        return tested(copy, own) or ("" if quick else tested(copy, ["-n", "auto", "--ignore=tests/tools"]))


def main() -> None:
    """Try the mutants that are named by their numbers, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="only the tests of the mutant's own room")
    parser.add_argument("number", nargs="*", type=int)
    given = parser.parse_args()
    chosen = given.number or range(len(MUTANTS))
    for number in chosen:
        place(MUTANTS[number][1])
    missed = 0
    for number in chosen:
        found = caught(number, quick=given.quick)
        missed += not found
        print(f"{number:3d} {'caught by ' + found if found else 'missed':60s} {MUTANTS[number][1]!r}", flush=True)
    print(f"{len(chosen)} mutants, {missed} missed")


if __name__ == "__main__":
    main()
