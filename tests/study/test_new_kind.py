"""What it takes to add a kind of study, and an engine, in a copy of the package."""

import json
import os
import shutil
import subprocess
import sys

import pandas as pd
import pytest
from common.places import ROOT

pytestmark = pytest.mark.long

#: The folder of the kind: what each key alone, changed by a factor, does to a motion.
OWN = {
    "__init__.py": '"""What changing keys one by one does."""\n',
    "study.py": '''"""The study ``changes``: a motion with each key multiplied by a factor."""

from functools import partial

from vibroplat.columns import TEXT, Column
from vibroplat.config.plans import SweepPlan
from vibroplat.errors import ConfigError
from vibroplat.results.result import Answer, Result
from vibroplat.study.branches import study_table
from vibroplat.study.point import failed_record, point_task
from vibroplat.study.pool import StoredChain, run_stored
from vibroplat.study.study import COMPARED, CrossCheckCase, Study, run_study
from vibroplat.study.sweep import SWEEP

COLUMNS = {"key": Column("key that is changed", kind=TEXT), **{name: SWEEP[name] for name in COMPARED}}


class ChangesStudy(Study):
    """A motion for each key."""

    kind = "changes"
    described = {"changes": ("`vibroplat changes`: a row for each key.", COLUMNS)}

    def __init__(self, scene):
        if scene.changes is None:
            raise ConfigError("this configuration has no changes section; add changes: {keys: [...]}")
        self.scene, self.plan = scene, scene.changes

    def chains(self, store):
        """Return how many keys there are."""
        return len(self.plan.keys)

    def _task(self, key, other=lambda scene: scene):
        supply = self.scene.drive.supply_frequency_hz
        plan = SweepPlan.model_validate({"supply_frequency_hz": {"start": supply, "stop": supply}})
        value = self.plan.factor * self.scene.to_tree()[key.partition(".")[0]][key.partition(".")[2]]
        return point_task(other(self.scene.replace({key: value})), plan, None, (0,))

    def run(self, store, workers, progress):
        """Measure the motions."""

        def chain(key):
            return (yield self._task(key))

        chains = [StoredChain(chain(key), store, key) for key in self.plan.keys]
        records = run_stored(chains, workers, lambda done: progress(done, len(chains)))
        rows = [{"key": key, **record["row"]} for key, record in zip(self.plan.keys, records, strict=True)]
        table = study_table(rows, list(COLUMNS), COLUMNS)
        failed = [row["detail"] for row in rows if row["outcome"] != "ok"]
        return Result("changes", self.scene, {"changes": table}, Answer({"keys": str(len(table))}, failures=failed))

    def cross_check_cases(self, result, store, other):
        """Repeat all of them."""
        rows = result.changes.to_dict("records")
        return [CrossCheckCase(f"with {row['key']}", self._task(row.pop("key"), other), row) for row in rows]


STUDY = ChangesStudy


def changes(scene, **options):
    """Change keys one by one."""
    return run_study(ChangesStudy, scene, **options)
''',
    "picture.py": '''"""The picture of changes."""

from vibroplat.results import content, picture

OPTIONS = ()


def pictures(results, kinds=()):
    """Return a panel for each measure."""
    return [_picture(result) for result in results]


def _picture(result):
    table = result.columns("changes", ("key",), ("rms_y_m", "excitation_frequency_hz"))
    panels, left = content.measures(table, content.DRAWN)
    return picture.Picture(
        name="changes",
        heading="Changes",
        title=result.name,
        table=table,
        table_name="changes",
        axes=content.axes_of(table, ["excitation_frequency_hz"]),
        panels=panels,
        series=[picture.Series("motions", content.rows_of(table["key"].notna()), mode="markers")],
        caption=left,
    )
''',
}
#: What is added elsewhere, by files: the line behind which it stands.
ADDED = {
    "config/kinds.py": {
        "    for kind in (\n": (
            "        Kind(\n"
            '            "changes",\n'
            '            "changes of keys",\n'
            '            "changes",\n'
            '            "changing.study",\n'
            '            "Change keys one by one.",\n'
            '            "Writes a table with a row for each key to OUT/NAME.",\n'
            "        ),\n"
        )
    },
    "config/study_plans.py": {
        "#: The sections of a scene that ask for studies.\n": "from vibroplat.config.changes import ChangesPlan\n",
        "PLANS: dict[str, type[Section]] = {\n": '    "changes": ChangesPlan,\n',
    },
    "config/scene.py": {
        "    design: DesignPlan | None = described(": (
            '    changes: "ChangesPlan | None" = described(None, "", "what vibroplat changes does")\n'
        ),
        "from vibroplat.config.drive import Drive, SupplyInterval\n": (
            "from vibroplat.config.changes import ChangesPlan\n"
        ),
    },
    "../tests/test_rooms.py": {'        "designs",\n': '        "changing",\n'},
    "../tests/results/test_result.py": {"PLANS = {\n": '    "changes": {"keys": ["machine.platform_mass_kg"]},\n'},
    "../results/method.md": {"| `designs` |": "| `changing` | what keys do one by one |\n"},
}
#: Tests that a kind must pass without further lines in them.
TESTS = (
    *("tests/test_rooms.py", "tests/results/test_result.py::test_a_result_is_loaded_as_it_was_computed[changes]"),
    "tests/page/test_page.py::test_a_directory_without_results_is_refused",
    "tests/cli/test_command_line.py::test_help_names_the_commands_and_h_is_short_for_it",
    "tests/config/test_messages.py",
)
#: An engine in a module of its own, and the line that makes it known. It is none of the kernels, which stay compiled.
ENGINE = "from vibroplat.integrate.taylor import TaylorEngine\n\n\nclass Again(TaylorEngine):\n    name = 'again'\n"
KNOWN = {"ENGINES = {\n": '    "again": EngineKind("changing.again.Again", "integrate.taylor.carry"),\n'}
#: Its section, which stands beside the others.
PLAN = '''"""The section ``changes``."""

from vibroplat.config.schema import Section, described


class ChangesPlan(Section):
    """Keys and a factor."""

    keys: list[str] = described(..., "", "keys that are changed")
    factor: float = described(1.1, "", "factor of each key")
'''
CONFIGURATION = """
extends: configs/quickstart.yaml
name: toy
solver: {engine: taylor}
changes: {keys: [machine.platform_mass_kg, machine.stiffness_y_n_per_m], factor: 1.02}
"""
#: Most files and lines besides the folder of a kind: the file of its section is one of them, with all its lines.
FILES, LINES = 7, 28


@pytest.fixture(scope="module")
def vibroplat(tmp_path_factory, kernels):
    """A function that runs the program with the kind added."""
    copy = tmp_path_factory.mktemp("house")
    shutil.copytree(ROOT / "vibroplat", copy / "vibroplat", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("configs", "tests", "results"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    (copy / "vibroplat/changing").mkdir()
    for name, text in OWN.items():
        (copy / "vibroplat/changing" / name).write_text(text)
    (copy / "vibroplat/config/changes.py").write_text(PLAN)
    (copy / "vibroplat/changing/again.py").write_text(ENGINE)
    for name, lines in {**ADDED, "config/engines.py": KNOWN}.items():
        path = copy / "vibroplat" / name
        text = path.read_text()
        for before, line in lines.items():
            (place,) = (place for place in range(len(text)) if text.startswith(before, place))
            end = text.index("\n", place) + 1
            text = text[:end] + line + text[end:]
        path.write_text(text)
    (copy / "toy.yaml").write_text(CONFIGURATION)

    def run(*arguments, code=0):
        environment = os.environ | {"PYTHONPATH": str(copy)}
        program = [sys.executable, *(("-m", "vibroplat") if arguments[0] != "-c" else ())]
        done = subprocess.run([*program, *arguments], cwd=copy, env=environment, capture_output=True, check=False)
        assert done.returncode == code, done.stderr.decode()
        return done.stdout.decode() + done.stderr.decode()

    run.copy = copy
    return run


def test_a_kind_takes_a_folder_and_few_lines_elsewhere(vibroplat):
    added = [*(line for lines in ADDED.values() for line in lines.values()), PLAN]
    assert len([*ADDED, PLAN]) <= FILES
    assert sum(text.count("\n") for text in added) <= LINES
    assert "changes  Change keys one by one." in vibroplat("--help")
    assert "## changes" in vibroplat("columns")
    assert "`changes.keys`" in vibroplat("schema", "--markdown")
    printed = vibroplat("changes", "toy.yaml", "--check", "--jobs", "2")
    assert "checked by: engine native, 2 of 2 motions agree" in printed
    directory = vibroplat.copy / "results/toy/changes"
    assert json.loads((directory / "provenance.json").read_text())["check"]["disagreements"] == []
    assert "2 tasks from before" in vibroplat("changes", "toy.yaml", "--resume")
    assert "no changes section" in vibroplat("changes", "configs/quickstart.yaml", code=2)
    table = pd.read_parquet(directory / "changes.parquet")
    assert table["key"].tolist() == ["machine.platform_mass_kg", "machine.stiffness_y_n_per_m"]
    assert table["sync"].tolist() == ["antiphase"] * 2
    assert vibroplat("plot", "results/toy", "--kind", "changes").split() == ["results/toy/changes/changes.png"]
    assert "Changes" in (vibroplat.copy / vibroplat("report", "results/toy").split()[-1]).read_text()
    python = "from vibroplat import changes, load, load_config; fresh = changes(load_config('toy.yaml'));"
    python += "assert load('results/toy').changes.equals(fresh.changes); print(fresh); fresh.plot()"
    assert "keys                        2" in vibroplat("-c", python)


def test_a_kind_needs_no_further_lines_in_tests(vibroplat):
    for page, printed in (("configuration", ("schema", "--markdown")), ("columns", ("columns",))):
        (vibroplat.copy / f"results/{page}.md").write_text(vibroplat(*printed))
    told = vibroplat("-c", f"import pytest, sys; sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', *{TESTS!r}]))")
    assert "passed" in told


def test_an_engine_takes_its_module_and_a_line(vibroplat):
    for engine in ("taylor", "again"):
        vibroplat("run", "configs/quickstart.yaml", "--engine", engine, "--out", engine)
    tables = (vibroplat.copy / engine / "quickstart/run/trajectory.parquet" for engine in ("taylor", "again"))
    pd.testing.assert_frame_equal(*map(pd.read_parquet, tables), check_exact=True)
    refused = vibroplat("run", "configs/quickstart.yaml", "--engine", "heun", code=2)
    assert "allowed: 'auto', 'again', 'native'" in refused
    assert "again" in vibroplat("schema", "--markdown")
    checked = vibroplat(
        "run", "configs/quickstart.yaml", "--engine", "again", "--check", "--set", "solver.tolerance=1e-12"
    )
    assert "engine native" in checked
