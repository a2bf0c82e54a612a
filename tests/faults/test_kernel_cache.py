"""Where the machine code of kernels is kept, and that it is never out of date."""

import ast
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest

import vibroplat
from vibroplat import Scene, simulate
from vibroplat.integrate import announce_compilation
from vibroplat.kernels import cache
from vibroplat.kernels.target import GENERIC, processor

PACKAGE = Path(vibroplat.__file__).parent
#: Folders with kernels.
ROOMS = ("hybrid", "integrate", "kernels", "model", "observe", "shooting")
#: A source with a kernel.
KERNEL = "from vibroplat.kernels.compiled import inlined\n\n\n@inlined\ndef kernel(): ...\n"
#: What is told where there is no place for machine code.
NOWHERE = "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with one source in each room, in place of ours, as a new process finds it."""
    found = tmp_path / "site/vibroplat"
    for room in ROOMS:
        (found / room).mkdir(parents=True)
        (found / room / "source.py").write_text("one = 1\n")
        (found / room / "kernel.py").write_text(KERNEL)
    (found / "page").mkdir()
    (found / "page/source.py").write_text("from vibroplat.kernels.compiled import FloatArray\n")
    for name in cache.SHARED:
        (found / name).parent.mkdir(exist_ok=True)
        (found / name).write_text("two = 2\n")
    monkeypatch.setattr(cache, "PACKAGE", found)
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    yield found
    forget()


def forget():
    """Forget what this process has found, as a new one would not know it."""
    for known in (cache.rooms, cache._name, cache.folder, cache._readable, cache._tell_damaged, processor):
        known.cache_clear()


def found(package):
    """Folder that keeps machine code, found anew; None where there is none."""
    forget()
    return cache.folder()


def block(folder):
    """Let a folder be one that cannot be written, for root as well."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("in the way")


def test_installation_without_a_home_keeps_its_own(package):
    assert found(package).parent == package / "__pycache__"
    assert cache.notice() == ""


def test_all_checkouts_of_a_version_share_the_users_cache(package, tmp_path, monkeypatch):
    folders = set()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("first", "second"):
        monkeypatch.setattr(cache, "PACKAGE", shutil.copytree(package, tmp_path / name / "vibroplat"))
        folders.add(found(package))
    assert len(folders) == 1
    assert folders.pop().parent == tmp_path / "home/.cache/vibroplat"


@pytest.mark.parametrize("whose", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "package"])
def test_folder_that_others_can_write_to_is_not_used(whose, package, tmp_path, monkeypatch, caplog):
    """What they plant there would be executed; above what was made by us they can put another in its place."""
    place = package if whose == "package" else tmp_path / whose
    place.mkdir(exist_ok=True)
    if whose != "package":
        monkeypatch.setenv(whose, str(place))
    used = found(package)
    assert used.is_relative_to(place)
    for written in (place, used):
        written.chmod(0o777)
        assert not found(package).is_relative_to(place)
        assert caplog.messages[-1] == f"machine code in {used.parent} is not used: others can write to {written}"
        written.chmod(0o700)


def test_folder_of_another_user_is_not_used(package, tmp_path, monkeypatch):
    """With sudo root may have the home of the user who called it."""
    if os.getuid():
        pytest.skip("only root can give a folder to another user")
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, 12345, 12345)
    monkeypatch.setenv("HOME", str(home))
    assert found(package).parent == package / "__pycache__"


def test_shipped_machine_code_is_read_first_unless_others_can_write_to_it(package):
    shipped = package / cache.SHIPPED / found(package).name
    shipped.mkdir(parents=True)
    forget()
    assert cache._readable()[0] == shipped
    shipped.chmod(0o702)
    forget()
    assert shipped not in cache._readable()


def test_read_only_installation_without_a_home_uses_a_temporary_folder_and_says_so(package, tmp_path):
    block(package / "__pycache__")
    assert found(package).is_relative_to(tmp_path / "temporary")
    own = tmp_path / f"temporary/numba-{os.getuid()}"
    assert own.stat().st_mode & 0o777 == 0o700
    told = cache.notice()
    assert told == f"they are kept in {own}, the only folder that can be written; NUMBA_CACHE_DIR names another"


@pytest.mark.parametrize("why", ["none", "blocked"])
def test_without_any_place_nothing_is_kept_and_the_notice_says_so(why, package, tmp_path, monkeypatch):
    block(package / "__pycache__")
    if why == "none":

        def nowhere():
            raise FileNotFoundError(2, "No usable temporary directory found")

        monkeypatch.setattr(tempfile, "gettempdir", nowhere)
    else:
        block(tmp_path / f"temporary/numba-{os.getuid()}")
    assert found(package) is None
    assert cache.notice() == NOWHERE


@pytest.mark.parametrize("told", ["this happens once for each engine and takes about half a minute", NOWHERE])
def test_first_engine_says_once_that_it_compiles(told, command, here, monkeypatch, caplog, kernels):
    announce_compilation.cache_clear()
    monkeypatch.setattr("vibroplat.kernels.cache.is_compiled", lambda kernel: False)
    if told == NOWHERE:
        monkeypatch.setattr(cache, "folder", lambda: None)
        (here / "short.yaml").write_text("run: {duration_s: 0.01}\n")
        assert command("run", "short.yaml").code == 0
    for _ in range(2):
        simulate(Scene().replace({"run.duration_s": 0.001}), keep="summary")
    assert caplog.messages == [f"compiling the numerical kernels; {told}"]
    announce_compilation.cache_clear()


def test_change_of_any_source_is_another_folder(package):
    places = [f"{room}/source.py" for room in ROOMS] + list(cache.SHARED)
    folders = [found(package)]
    for place in places:
        (package / place).write_text("three = 3\n")
        folders.append(found(package))
    assert len(set(folders)) == 1 + len(places)
    assert {folder.parent for folder in folders} == {folders[0].parent}
    (package / "page/source.py").write_text("three = 3\n")
    assert found(package) == folders[-1]


def test_other_compiler_or_setting_of_it_is_another_folder(package, monkeypatch):
    folders = [found(package)]
    for holder in (numba, cache.llvmlite):
        monkeypatch.setattr(holder, "__version__", "0.0")
        folders.append(found(package))
    for setting in cache.SETTINGS:
        monkeypatch.setattr(numba.core.config, setting, 77)
        folders.append(found(package))
    assert len(set(folders)) == 3 + len(cache.SETTINGS) > 5


def test_list_of_places_from_the_environment_does_not_replace_ours():
    code = "from vibroplat.kernels.compiled import copy; print(copy.stats.cache_path)"
    environment = os.environ | {"NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).name.startswith("kernels-")


def kernels_of_sources():
    """Yield the source and the name of each function that is compiled."""
    decorators = {"compiled", "inlined", "fused", "fused_inline", "callback", "numba.njit", "numba.cfunc"}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for decorator in getattr(node, "decorator_list", ()):
                if ast.unparse(decorator).partition("(")[0] in decorators:
                    yield path.relative_to(PACKAGE).as_posix(), node.name


def test_every_kernel_has_a_name_of_its_own_in_a_room_that_the_digest_covers():
    """Machine code is kept by the names of kernels: two of one name in a file would be mixed up."""
    names = sorted(kernels_of_sources())
    assert len(names) > 100
    assert sorted(set(names)) == names
    assert {path.rpartition("/")[0] for path, _ in names} == set(cache.rooms()) == set(ROOMS)


@pytest.mark.parametrize("how", ["lambda", "inside a function"])
def test_function_without_a_name_of_its_own_is_not_kept(how, monkeypatch):
    """Those of one factory differ in what they enclose."""

    def inside(x):
        return x

    monkeypatch.setattr(cache.inspect, "getfile", lambda _: str(PACKAGE / "model/source.py"))
    function = inside if how == "inside a function" else lambda x: x
    assert not isinstance(cache.cache_of(function), cache.KernelCache)
    assert isinstance(cache.cache_of(kernels_of_sources), cache.KernelCache)


def test_no_number_that_the_digest_does_not_cover_is_imported_beside_kernels():
    """A constant from elsewhere would stay compiled into kernels."""
    covered = {*cache.rooms(), *(name.removesuffix(".py").replace("/", ".") for name in cache.SHARED)}
    imported = set()
    for path in {path for room in cache.rooms() for path in (PACKAGE / room).glob("*.py")}:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vibroplat."):
                imported |= {(node.module.removeprefix("vibroplat."), name.name) for name in node.names}
    assert ("config.coordinates", "COORDINATES") in imported
    elsewhere = {(m, n) for m, n in imported if m not in covered and m.partition(".")[0] not in covered}
    assert ("config.scene", "Scene") in elsewhere
    found = {(m, n): getattr(importlib.import_module(f"vibroplat.{m}"), n, None) for m, n in elsewhere}
    assert [place for place, value in found.items() if isinstance(value, int | float | np.ndarray)] == []


def digests(folder, *ages):
    for number, age in enumerate(ages):
        other = folder / f"kernels-{number:016d}"
        other.mkdir(parents=True)
        (other / "kernel.bin").write_text("machine code")
        used = time.time() - age * 86_400.0
        os.utime(other, (used, used))


def test_old_machine_code_is_removed_unless_a_running_process_may_use_it(package):
    room = package / "__pycache__"
    digests(room, *[0.5] * 10)
    current = found(package)
    assert len(list(room.iterdir())) == 11
    shutil.rmtree(room)
    digests(room, *range(2, 30))
    found(package)
    left = sorted(path.name for path in room.iterdir())
    assert left == sorted([current.name, *(f"kernels-{number:016d}" for number in range(cache.SPARE))])


def test_machine_code_in_use_counts_as_used(package):
    folder = found(package)
    os.utime(folder, (0.0, 0.0))
    assert found(package).stat().st_mtime == pytest.approx(time.time(), abs=60.0)


@pytest.fixture
def kernel(package, monkeypatch):
    monkeypatch.setattr(cache.rtsys, "initialize", lambda _context: None)
    monkeypatch.setattr(cache.CompileResult, "_rebuild", lambda _context, *parts: parts)
    (package / "model/source.py").write_text("three = 3\n")
    forget()
    kernel = Word(package)
    kernel.save()
    return kernel


class Word:
    def __init__(self, package):
        self._cache = cache.KernelCache("model.source.function")
        self.path = Path(self._cache.cache_path) / self._cache._file(SIGNATURE)
        self.shipped = package / cache.SHIPPED / self.path.parent.name / self.path.name

    def save(self):
        library = SimpleNamespace(has_dynamic_globals=False)
        self._cache.save_overload(SIGNATURE, SimpleNamespace(library=library, _reduce=lambda: ("word",)))

    def load(self):
        forget()
        return self._cache.load_overload(SIGNATURE, None)


SIGNATURE = numba.float64(numba.float64)


@pytest.mark.parametrize("shipped", [False, True])
@pytest.mark.parametrize("how", ["flipped", "cut", "empty", "writable"])
def test_file_that_is_not_as_it_was_kept_is_compiled_anew(how, shipped, kernel, caplog):
    path = kernel.path
    if shipped:
        path = kernel.shipped
        path.parent.mkdir(parents=True)
        kernel.path.rename(path)
    assert kernel.load() == ("word",)
    code = path.read_bytes()
    damaged = {"flipped": code[:40] + bytes([code[40] ^ 1]) + code[41:], "cut": code[:40], "empty": b""}
    if how == "writable":
        path.chmod(0o666)
    else:
        path.write_bytes(damaged[how])
    assert kernel.load() is None
    assert kernel._cache.load_overload(SIGNATURE, None) is None
    assert caplog.messages == [f"machine code in {path.parent}: damaged files are compiled anew"], "told once"
    kernel.save()
    assert kernel.load() == ("word",)
    assert kernel.path.stat().st_mode & 0o777 == 0o600


def test_sources_that_are_changed_while_a_process_runs_have_no_machine_code_of_it(kernel, package):
    """It has loaded the old ones; what it compiles is not kept, as nobody knows when they were changed."""
    kernel.path.unlink()
    (package / "model/source.py").write_text("four = 4\n")
    kernel.save()
    assert not kernel.path.exists()


#: Calls a kernel of polynomials from Python, and prints what it gives and what was found on disk of another one.
CALL = """
import numpy as np
from vibroplat.kernels.polynomial import {name}, value

c = np.array([[1.0], [-0.5], [0.2], [1.0]])
found = {name}({arguments})
hits, misses = value._inside.stats.cache_hits, value.stats.cache_misses
print(np.round(found, 9), sum(hits.values()), sum(misses.values()))
"""


def called(tmp_path, name, arguments):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    line = [sys.executable, "-c", CALL.format(name=name, arguments=arguments)]
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.long
def test_what_kernels_call_is_kept_for_kernels_of_later_processes(tmp_path):
    """``value`` is compiled for ``at_highest`` alone, and taken from disk for ``first_downcrossing``."""
    assert called(tmp_path, "at_highest", "c, 3, 0").endswith(" 0 0")
    names = {path.name.split("-")[0] for path in tmp_path.rglob("*.bin")}
    assert names == {f"kernels.polynomial.{name}" for name in ("at_highest", "slope.inside", "value.inside")}
    assert called(tmp_path, "first_downcrossing", "c, 3, 0, 0").endswith(" 1 0")


def chosen(monkeypatch, features=None, **settings):
    """What kernels are compiled for by a process with these settings of numba, on a machine with these features."""
    for name in ("CPU_NAME", "CPU_FEATURES"):
        monkeypatch.setattr(numba.core.config, name, settings.get(name))
    if features is not None:
        monkeypatch.setattr("vibroplat.kernels.target.get_host_cpu_features", lambda: features)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    processor.cache_clear()
    return processor()


V3 = ",".join(f"+{feature}" for feature in GENERIC["x86_64"][1].split())


def test_machines_share_one_target_unless_they_lack_a_feature(package, monkeypatch):
    assert chosen(monkeypatch, V3) == chosen(monkeypatch, f"+avx512f,{V3}") == ("x86-64-v3", "")
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_name", lambda: "nehalem")
    for feature in V3.split(","):
        less = ",".join(one for one in V3.split(",") if one != feature)
        assert chosen(monkeypatch, less) == ("nehalem", less)
        less = V3.replace(feature, f"-{feature[1:]}")
        assert chosen(monkeypatch, less) == ("nehalem", less)


def test_choice_of_the_user_goes_before(package, monkeypatch):
    assert chosen(monkeypatch, V3, CPU_NAME="nehalem", CPU_FEATURES="") == ("nehalem", "")
    assert chosen(monkeypatch, V3, CPU_NAME="icelake-server") == ("icelake-server", V3)
    one = found(package)
    assert chosen(monkeypatch, V3, CPU_NAME="nehalem") == ("nehalem", V3)
    assert found(package) != one
