"""Arrows between the files of the package point down, from room to room and in each room, and there is no circle.

Every import counts: at the top of a file, inside functions, for type annotations alone, and names of modules that are
given to functions. Only ``vibroplat/__init__.py`` may know everything; a public name that a file takes from it counts
as an import of the module where it is.
"""

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import vibroplat

PACKAGE = Path(vibroplat.__file__).parent
#: From the lowest to the highest; ``errors``, ``extensions``, ``columns`` and ``frames`` are loose modules.
ROOMS = (
    *("errors", "extensions", "columns", "frames", "system", "kernels", "config", "model", "hybrid"),
    *(
        "integrate",
        "observe",
        "shooting",
        "report",
        "results",
        "measured",
        "inspection",
        "motion",
        "study",
        "check",
        "continuation",
        "thresholds",
        "basin",
        "designs",
        "fitting",
        "paper",
    ),
    *("plots", "page", "bench", "cli"),
    "__main__",
)
#: Files of tests that the map of the house names.
OF_TESTS = {"tests/test_rooms.py", "tests/results/test_result.py", "tests/study/test_new_kind.py"}
#: What the page may use: it is drawn from result tables alone.
OF_THE_PAGE = {"errors", "columns", "system", "config", "results", "measured", "plots", "page"}


def name_of(path):
    """Name of a file's module below the package."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


#: Public names, and the modules where they are.
PUBLIC = {f"vibroplat.{name}": module for name, module in vibroplat._HOMES.items()}
FILES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py")) if path != PACKAGE / "__init__.py"}


def named(tree):
    """Names of all modules and members of the package that a file asks for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call):
            yield from (a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str))
        elif isinstance(node, ast.Attribute):
            yield ast.unparse(node)


def arrows(path):
    """Modules of the package that a file imports."""
    for name in named(ast.parse(path.read_text(encoding="utf-8"))):
        parts = PUBLIC.get(name, name).split(".")
        if parts[0] == "vibroplat":
            ends = (".".join(parts[1:end]) for end in range(len(parts), 1, -1))
            yield from [end for end in ends if end in FILES][:1]


def test_arrows_point_down():
    graph = {name: set(arrows(path)) for name, path in FILES.items()}
    assert sum(map(len, graph.values())) > len(graph)
    rank = {room: place for place, room in enumerate(ROOMS)}
    rooms = {(name, target.split(".")[0]) for name, targets in graph.items() for target in targets}
    assert {(name, room) for name, room in rooms if rank[room] > rank[name.split(".")[0]]} == set()
    assert {(name, room) for name, room in rooms if name.startswith("page") and room not in OF_THE_PAGE} == set()
    TopologicalSorter(graph).prepare()  # CycleError names a circle


#: What docstrings and comments refer to: a name of their own file, after a dot one of any file, or with its module.
REFERENCE = re.compile(r":(?:attr|class|data|func|meth|mod):`~?([\w.]+)`")


#: Packages of others that they refer to.
ELSEWHERE = {"concurrent", "multiprocessing", "numpy", "pandas"}


def test_docstrings_name_what_is_there():
    texts = {name: path.read_text(encoding="utf-8") for name, path in FILES.items()}
    others = {name: set(re.findall(r"\w+", REFERENCE.sub("", text))) for name, text in texts.items()}
    missing = set()
    for name, text in texts.items():
        for reference in REFERENCE.findall(text):
            parts = reference.removeprefix("vibroplat.").split(".")
            ends = [end for end in range(len(parts), 0, -1) if ".".join(parts[:end]) in texts]
            known, rest = others[name], parts
            if reference.startswith("."):
                known, rest = set().union(*others.values()), parts[1:]
            elif ends:
                known, rest = others[".".join(parts[: ends[0]])], parts[ends[0] :]
            if not (known.issuperset(rest) or reference in PUBLIC or parts[0] in ELSEWHERE):
                missing.add((name, reference))
    assert missing == set()


def test_the_map_of_the_house_names_files_that_are_there():
    page = (PACKAGE.parent / "results" / "method.md").read_text("utf-8")
    named_files = set(re.findall(r"`((?:\w+/)*\w+\.py)`", page.partition("## The code")[2])) - OF_TESTS
    assert len(named_files) > 8
    known = {path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py")}
    assert {name for name in named_files if not any(f"/{path}".endswith(f"/{name}") for path in known)} == set()


def test_studies_know_nothing_of_the_paper():
    assert [
        name for name, path in FILES.items() if name.startswith("study") and "paper" in path.read_text("utf-8")
    ] == []
