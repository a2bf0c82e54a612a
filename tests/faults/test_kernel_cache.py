"""Where the machine code of kernels is kept, and that it is never out of date."""

import ast
import importlib
import os
import shutil
import struct
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
#: What is told where there is no place for machine code.
NOWHERE = "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with one source in each room, in place of ours, as a new process finds it."""
    found = tmp_path / "site/vibroplat"
    for room in cache.ROOMS:
        (found / room).mkdir(parents=True)
        (found / room / "source.py").write_text("one = 1\n")
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
    for known in (cache._state, cache._name, cache.folder, cache._readable, cache._tell_unfit, processor):
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


def test_folder_that_others_can_write_to_is_not_used(package, tmp_path, monkeypatch, caplog):
    """What they plant there would be executed: that of the variable, the home, the package or the temporary one."""
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    places = [tmp_path / "NUMBA_CACHE_DIR", tmp_path / "XDG_CACHE_HOME", tmp_path / "HOME/.cache", package]
    for place in places:
        place.mkdir(parents=True, exist_ok=True)
        assert found(package).is_relative_to(place)
        place.chmod(0o777)  # above what was made by us
    assert found(package).is_relative_to(tmp_path / "temporary")
    (tmp_path / "temporary").chmod(0o777)  # not sticky: others can replace what is in it
    caplog.clear()
    assert found(package) is None
    told = [f"machine code in {place}/vibroplat is not used: others can write to {place}" for place in places[:3]]
    told.append(f"machine code in {package}/__pycache__ is not used: others can write to {package}")
    assert caplog.messages[:4] == told


def test_folder_of_another_user_is_not_used(package, tmp_path, monkeypatch, caplog):
    """With sudo root may have the home of the user who called it."""
    if os.getuid():
        pytest.skip("only root can give a folder to another user")
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, 12345, 12345)
    monkeypatch.setenv("HOME", str(home))
    assert found(package).parent == package / "__pycache__"
    assert caplog.messages == [f"machine code in {home}/.cache/vibroplat is not used: {home} belongs to another user"]


def give_access(place):
    """Let another user write in a place, by a list of access as setfacl writes it."""
    nobody, tags = 2**32 - 1, {1: 7, 2: 7, 4: 5, 16: 7, 32: 0}
    entries = [struct.pack("<HHI", tag, right, 12345 if tag == 2 else nobody) for tag, right in tags.items()]
    try:
        os.setxattr(place, "system.posix_acl_access", struct.pack("<I", 2) + b"".join(entries))
    except (AttributeError, OSError):
        pytest.skip("there are no lists of access")


def test_shipped_machine_code_that_others_can_write_to_is_not_used(package):
    shipped = package / cache.SHIPPED / found(package).name
    shipped.mkdir(parents=True)
    forget()
    assert cache._readable()[0] == shipped
    shipped.chmod(0o702)
    forget()
    assert shipped not in cache._readable()


def test_group_of_the_user_alone_may_write(package, tmp_path, monkeypatch):
    """As where each user has a group of his name, and files may be written by the group."""
    chosen = tmp_path / "chosen"
    chosen.mkdir()
    chosen.chmod(0o770)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(chosen))
    monkeypatch.setattr("pwd.getpwuid", lambda _user: SimpleNamespace(pw_name="ann"))
    group = chosen.stat().st_gid
    for name, members, users, used in (
        ("ann", [], ["ann"], True),
        ("ann", ["ben"], ["ann"], False),
        ("staff", [], ["ann"], False),
        ("ann", [], ["ann", "ben"], False),  # it is the first group of another, which its list does not tell
    ):
        known = [SimpleNamespace(pw_name=user, pw_gid=group) for user in users]
        monkeypatch.setattr("pwd.getpwall", lambda known=known: known)
        monkeypatch.setattr("grp.getgrgid", lambda _group, n=name, m=members: SimpleNamespace(gr_name=n, gr_mem=m))
        assert found(package).is_relative_to(chosen) == used


def test_read_only_installation_without_a_home_uses_a_temporary_folder_and_says_so(package, tmp_path):
    block(package / "__pycache__")
    assert found(package).is_relative_to(tmp_path / "temporary")
    own = tmp_path / f"temporary/numba-{os.getuid()}"
    assert own.stat().st_mode & 0o777 == 0o700
    told = cache.notice()
    assert told == f"they are kept in {own}, the only folder that can be written; NUMBA_CACHE_DIR names another"


def test_user_without_an_entry_in_the_list_of_users_has_a_place(package, tmp_path, monkeypatch):
    def unknown(_user):
        raise KeyError("getpwuid(): uid not found")

    monkeypatch.setattr("pwd.getpwuid", unknown)
    monkeypatch.setattr(os, "getuid", lambda: os.stat(tmp_path).st_uid)
    monkeypatch.setenv("HOME", "/proc/nowhere")
    block(package / "__pycache__")
    assert found(package).is_relative_to(tmp_path / "temporary")


def test_link_in_the_temporary_folder_cannot_be_turned_elsewhere_later(package, tmp_path):
    block(package / "__pycache__")
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / f"temporary/numba-{os.getuid()}").symlink_to(tmp_path / "elsewhere")
    assert found(package).parent == tmp_path / "elsewhere/vibroplat"


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
    monkeypatch.setattr("vibroplat.kernels.cache.is_compiled", lambda engine="auto": False)
    if told == NOWHERE:
        monkeypatch.setattr(cache, "folder", lambda: None)
        (here / "short.yaml").write_text("run: {duration_s: 0.01}\n")
        assert command("run", "short.yaml").code == 0
    for _ in range(2):
        simulate(Scene().replace({"run.duration_s": 0.001}), keep="summary")
    assert caplog.messages == [f"compiling the numerical kernels; {told}"]
    announce_compilation.cache_clear()


def test_change_of_any_source_is_another_folder(package):
    places = [f"{room}/source.py" for room in cache.ROOMS] + list(cache.SHARED)
    folders = [found(package)]
    for place in places:
        (package / place).write_text("three = 3\n")
        folders.append(found(package))
    assert len(set(folders)) == 1 + len(places)
    assert {folder.parent for folder in folders} == {folders[0].parent}


#: A source with a kernel, and what its machine code depends on.
KERNEL = '''"""Kernels."""

import numpy as np

from vibroplat.kernels.compiled import compiled, fused

#: Ratio.
HALF, SIZE = 0.5, 1e-12


@compiled
def scaled(x: float, n: int = 3) -> float:
    """Scale a number."""
    # by halves
    for _ in range(n):
        x = HALF * x + SIZE
        x -= SIZE
    return x
'''
#: Edits that leave machine code as it is.
PROSE = [
    ("    # by halves\n", "    # n times\n"),
    ("    return x", "    return x  # scaled"),
    ('"""Kernels."""', '"""Kernels of this room."""'),
    ('    """Scale a number."""\n', ""),
    ("#: Ratio.\n", "#: Ratio,\n#: of all.\n\n\n"),
    ("\n", "\r\n"),
]
#: Edits that change machine code, or may do so.
CODE = [
    ("0.5", "0.5000000000000001"),
    ("HALF, SIZE = 0.5", "HALF, SIZE = 1"),
    ("@compiled\n", ""),
    ("HALF * x + SIZE", "HALF * (x + SIZE)"),
    ("n: int = 3", "n: int = 4"),
    ("    return x", "        return x"),
    ("HALF, SIZE = 0.5, 1e-12", 'HALF, SIZE = 0.5, 1e-12\nNAME = "x"'),
]


def edited(package, old, new):
    source = package / "model/source.py"
    assert old in KERNEL
    source.write_bytes(KERNEL.replace(old, new).encode())
    current = found(package)
    source.write_text(KERNEL)
    return current


def test_edits_of_code_alone_are_other_folders(package):
    before = edited(package, "", "")
    assert {edited(package, *change) for change in PROSE} == {before}
    # what cannot be parsed counts as it is
    broken = [("(x: float", text) for text in ("(x float", "(x  float", "(x\0")]
    others = {edited(package, *change) for change in (*CODE, *broken)}
    assert len(others | {before}) == len(CODE) + len(broken) + 1


def refuse(_source):
    pytest.fail("it was parsed")


def test_sources_that_were_parsed_once_are_not_parsed_again(package, monkeypatch):
    """With comments edited back and forth as well."""
    (package / "model/source.py").write_text(KERNEL)
    folders = {found(package), edited(package, *PROSE[0]), found(package)}
    monkeypatch.setattr(cache, "_code", refuse)
    folders |= {found(package), edited(package, *PROSE[0])}
    assert len(folders) == 1
    assert len(list(folders.pop().glob("sources-*"))) == 2


def test_shipped_machine_code_tells_the_sources_that_it_is_of(package, monkeypatch):
    """A process that can write nothing need not parse either."""
    kept = found(package)
    shutil.copytree(kept, package / cache.SHIPPED / kept.name)
    shutil.rmtree(kept.parent)
    block(package / "__pycache__")
    block(Path(tempfile.gettempdir()) / f"numba-{os.getuid()}")
    monkeypatch.setattr(cache, "_code", refuse)
    assert found(package) is None
    assert [place.name for place in cache._readable()] == [kept.name]


def test_name_that_others_can_plant_is_not_believed(package):
    kept = found(package)
    other = kept.with_name("kernels-0123456789abcdef")
    kept.rename(other)
    assert found(package) == other  # whoever can write there is this user
    other.chmod(0o777)
    assert found(package) == kept


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
    assert {path.rpartition("/")[0] for path, _ in names} <= set(cache.ROOMS)


@pytest.mark.parametrize("how", ["lambda", "inside a function"])
def test_function_without_a_name_of_its_own_is_not_kept(how, monkeypatch):
    """Those of one factory differ in what they enclose."""

    def inside(x):
        return x

    monkeypatch.setattr(cache.inspect, "getfile", lambda _: str(PACKAGE / "model/source.py"))
    function = inside if how == "inside a function" else lambda x: x
    assert not isinstance(cache.cache_of(function), cache.KernelCache)
    assert isinstance(cache.cache_of(refuse), cache.KernelCache)


def test_no_number_that_the_digest_does_not_cover_is_imported_beside_kernels():
    """A constant from elsewhere would stay compiled into kernels."""
    covered = {*cache.ROOMS, *(name.removesuffix(".py").replace("/", ".") for name in cache.SHARED)}
    imported = set()
    for path in {path for room in cache.ROOMS for path in (PACKAGE / room).glob("*.py")}:
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
    (room / ".old-kernels-0-1").mkdir()  # of a removal that was killed
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


def flip(code, bit=0):
    """One bit of a file is another, by default in the middle."""
    bit = bit or 4 * len(code)
    return code[: bit // 8] + bytes([code[bit // 8] ^ 1 << bit % 8]) + code[bit // 8 + 1 :]


def replace_by_link(path):
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


def replace_by_pipe(path):
    path.unlink()
    os.mkfifo(path)


#: What may have become of a file, and what is said of it.
SPOILED = {
    "flipped": (lambda path: path.write_bytes(flip(path.read_bytes())), "damaged files are"),
    "flipped digest": (lambda path: path.write_bytes(flip(path.read_bytes(), 3)), "damaged files are"),
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:40]), "damaged files are"),
    "empty": (lambda path: path.write_bytes(b""), "damaged files are"),
    "without digest": (lambda path: path.write_bytes(path.read_bytes()[cache.DIGEST_SIZE :]), "damaged files are"),
    "for all": (lambda path: path.chmod(0o666), "files that others can write to are"),
    "for a group": (lambda path: path.chmod(0o660), "files that others can write to are"),
    "for some": (give_access, "files that others can write to are"),
    "another's": (lambda path: os.chown(path, 12345, -1), "files of another user are"),
    "link": (replace_by_link, "links and unreadable files are"),
    "pipe": (replace_by_pipe, "what is no file is"),
}


@pytest.mark.parametrize("how", SPOILED)
def test_file_that_is_not_as_it_was_kept_is_not_used(how, kernel, monkeypatch, caplog):
    spoil, told = SPOILED[how]
    if how == "another's" and os.getuid():
        pytest.skip("only root can give a file to another user")
    monkeypatch.setattr(cache, "_is_users_own", lambda _group: how == "for some")
    assert kernel.load() == ("word",)
    spoil(kernel.path)
    assert kernel.load() is None
    assert kernel._cache.load_overload(SIGNATURE, None) is None
    assert caplog.messages == [f"machine code in {kernel.path.parent}: {told} compiled anew"], "told once"
    kernel.save()
    assert kernel.load() == ("word",)
    assert kernel.path.stat().st_mode & 0o777 == 0o600


def test_file_of_another_kernel_or_version_is_not_used(kernel):
    """Who may rename files must not choose what is called."""
    for other in (kernel.path.with_name("other.bin"), kernel.path.parents[1] / "kernels-0" / kernel.path.name):
        other.parent.mkdir(exist_ok=True)
        shutil.copy(kernel.path, other)
        with pytest.raises(OSError, match="damaged"):
            cache._machine_code(other)


def test_damaged_shipped_machine_code_is_compiled_once_with_a_line(kernel, caplog):
    kernel.shipped.parent.mkdir(parents=True)
    kernel.path.rename(kernel.shipped)
    assert kernel.load() == ("word",)
    kernel.shipped.write_bytes(flip(kernel.shipped.read_bytes()))
    assert kernel.load() is None
    assert caplog.messages == [f"machine code in {kernel.shipped.parent}: damaged files are compiled anew"]
    kernel.save()
    assert kernel.load() == ("word",)
    assert len(caplog.messages) == 1


def test_name_of_sources_that_is_not_believed_is_made_anew(kernel, package):
    state = kernel.path.with_name(cache._state())
    state.chmod(0o666)
    assert found(package) == kernel.path.parent
    assert state.stat().st_mode & 0o777 == 0o600


def test_sources_that_are_changed_while_a_process_runs_have_no_machine_code_of_it(kernel, package):
    """It has loaded the old ones; a process that begins later would take what they were compiled to for the new."""
    kernel.path.unlink()
    source = package / "model/source.py"
    before = source.read_text()
    source.write_text("four = 4\n")
    kernel.save()
    assert not kernel.path.exists()
    source.write_text(before)
    kernel.save()
    assert kernel.load() == ("word",)


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
    """``value`` is compiled for ``at_highest`` alone, not for Python, and taken from disk for ``value_range``."""
    assert called(tmp_path, "at_highest", "c, 3, 0").endswith(" 0 0")
    names = {path.name.split("-")[0] for path in tmp_path.rglob("*.bin")}
    assert names == {f"kernels.polynomial.{name}" for name in ("at_highest", "slope.inside", "value.inside")}
    assert called(tmp_path, "value_range", "c, 3, 0, 0.0, 1.0, (1.0, 1.7)").endswith(" 1 0")


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
