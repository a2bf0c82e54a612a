"""Configurations spoiled at random: what a slip of the hand, another program or a joker makes of a valid file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from common.places import ROOT

#: Valid texts with what the files of the repository do not have.
EXTRA = {
    "motors": "motors:\n  - {pole_pairs: 2, critical_slip: 0.15}\n  - {pole_pairs: 3}\nrun:\n  duration_s: 1.0\n",
    "state": (
        "extends: machines/printed.yaml\nmaterial:\n  mass_ratio: 0.2\nrun:\n  duration_s: 0.5\n  initial:\n"
        "    state:\n      x_m: 0.0\n      gap_m: 1.0e-3\n      phi1_rate_rad_per_s: 150.0\n"
    ),
    "sweep": (
        "extends: machines/calibrated.yaml\nsweep:\n  supply_frequency_hz:\n    start: 46.0\n    stop: 47.0\n"
        "    step: 0.5\n    direction: [up, down]\n  grid:\n    contact.restitution: [0.0, 0.3]\n"
        "    material.layers: [1, 2]\n  kind: response\n  settle_s: 1.0\n  seed: 3\n"
    ),
    "anchors": (
        "motors:\n  - &first {pole_pairs: 2, critical_torque_n_m: 1.2}\n  - {<<: *first, pole_pairs: 3}\n"
        "solver: {tolerance: 1.0e-7, engine: auto}\noutput: {sample_rate_hz: 500}\n"
    ),
}


def listed(text):
    """Values that stand between bars."""
    return [value for line in text.strip().splitlines() for value in line.strip().split(" | ")]


#: In the place of a value.
VALUES = (
    *listed(r"""
        ~ | null | true | no | [] | {} | [1] | [[1, 2], 3] | {a: 1} | text | '' | "" | '5' | 1:30 | 0 | -0.0 | -1
        -1e-3 | 1 | 2 | 0.5 | 1e-320 | 5e-324 | 1e-30 | 1e30 | 1e308 | 1e400 | -1e400 | .nan | .inf | -.inf | NaN | inf
        1_000 | 0x10 | 0o17 | 0b11 | 1e | 1.e5 | +.5 | ١٢ | 1,5 | 5 kg | 999999999999999999 | 18446744073709551616
        2147483648 | 2001-01-01 | 2001-12-14t21:59:43.10-05:00 | 2001-13-45 | !!binary aGVsbG8= | !!binary é
        !!set {a, b} | !!omap [a: 1, a: 2] | !!pairs [a: 1] | !!timestamp x | !!int 1.5 | !!float x | !!bool 7
        !!null 1 | !!str 5 | !local 5 | !<tag:yaml.org,2002:int> x | ! 5 | &a 1 | *a | *nope | << | >- | ' | "
        "\ud800" | "\udfff\ud800" | "\0" | "\x1b[2J" | "\u202e" | ال | ½ | @a | `a | %a | ? a | - 1 | : 1 | a: b: c
        # no | [1, 2 | {a: 1 | [up, up] | [up, sideways]
    """),
    *("", "1" + "00" * 200, "99" * 2500, "-" + "99" * 200, "0x" + "ff" * 200, "0x" + "ff" * 2500),
    *("0o" + "77" * 3000, "0." + "00" * 200 + "1", "1e" + "99" * 200, "|\n    text", "\u202eabc", "\ufeff"),
    *("𝟙", "１", "éé" * 1500, "xx" * 2500, "- " * 200 + "1", "[" * 150 + "]" * 150, "{a: " * 150 + "1"),
)

#: Lines put in somewhere.
LINES = (
    *listed(r"""
        machin: {} | machine: {platform_mas_kg: 1.0} | contact: {restituton: 0.3} | solver: {tol: 1e-6}
        material: {layers: 3} | material: {mass_ratio: 0.2, natural_frequency_hz: 1, stiffness_n_per_m: 1} | motor: {}
        motors: [{}, {}] | motors: [{}] | motors: {} | motor: ~ | sweep: ~ | sweep: {} | run: 5
        run: {initial: {state: {}}} | run: {initial: {state: {gap_m: -1}}} | run: {initial: {state: [1]}}
        run: {initial: {state: {mode: 5, t_s: x}}} | run: {duration_s: 1e300} | output: {sample_rate_hz: 1e300}
        drive: {supply_frequency_hz: 0} | sweep: {supply_frequency_hz: {start: 1, stop: 2, step: 1e-300}}
        sweep: {supply_frequency_hz: {start: 1, stop: 1e6, step: 1e-3}} | sweep: {supply_frequency_hz: 50} | 1: 2
        1.5: x | true: x | ~: x | 2001-01-01: 1 | a: &a {<<: *a} | a: &a [*a] | <<: {run: {duration_s: 2}} | <<: [1]
        <<: 5 | <<: *x | <<: [{run: 5}, {run: 6}] | &k name: a | *k : b | ... | %YAML 1.1 | %TAG ! x | - | - a | ] | }
        ? | : | name | name:x | nаme: x | náme: x | extends: | extends: [a] | extends: {a: 1} | extends: 5
        !!python/object/apply:os.system ["touch CANARY"] | !!python/object/apply:os.mkdir ["CANARY"]
        a: !!python/object/apply:os.system ["touch CANARY"] | a: !!python/object/apply:os.mkdir ["CANARY"]
        name: !!python/name:os.system | a: !!python/object/new:os.mkdir [CANARY] | a: !!python/module:antigravity
        !!python/object/apply:subprocess.Popen [[touch, CANARY]] : 1 | a: !!python/tuple [1]
    """),
    *("? [a, b]\n: 1", "? {a: 1}\n: 2", "0x" + "ff" * 2500 + ": 1", "a: &a [1, 2]\nb: *a", "--- "),
    *("---\na: 1\n---\nb: 2", "\tname: x", "  stray: 1", "|", "\x00", "\x07", "\x7f", "\x85", "\u2028"),
    *("\u2029", "\ufeff", "\u202ename: x", "'na\nme': x", "xx" * 2500 + ": 1", "\ud800"),
    *("? " + "kk" * 750 + "\n: 1", "##" * 1500, "  " * 150 + "a: 1"),
    *(
        f"sweep: {{supply_frequency_hz: {{start: 50, stop: 51}}, {keys}}}"
        for keys in (
            *listed("""
            grid: {a: [1]} | grid: {machine.: [1]} | grid: {'': [1]} | grid: {material.layers: [1, true]}
            grid: {contact.restitution: [.nan]} | grid: [1] | grid: {motors: [1]} | seed: 9223372036854775808
            settle_s: .nan | settle_s: 1e-320 | measure_s: 1e308 | grid: {"a\\ud800": [1]}
            """),
            "grid: {contact.restitution: [0x" + "f" * 5000 + "]}",
        )
    ),
)

#: Names of scenes that would lead elsewhere or could not be a directory.
NAMES = (
    *listed(r"""
        ../../x | .. | . | a/b | /x/y | a\b | con | nul | ~ | -rf | .hidden | a b | "a\nb" | "a\0b" | é | '' | *
        $(touch CANARY) | a;b | 5 | 1e3 | [a] | {a: 1} | null | true | "a\ud800" | "a\n" | a.. | a/../b | points.sqlite
        2001-01-01
    """),
    *("a\n b", "xx" * 50, "xx" * 50 + "x", "xx" * 2500, "\u202ea"),
)

#: What a file may be laid over. Devices without an end are tried apart: they could take the tests along.
BASES = (
    *listed(r"""
        c.yaml | ./c.yaml | link.yaml | loop-a.yaml | deep/../c.yaml | dangling.yaml | round.yaml | nope.yaml | deep | .
        .. | / | /root | /etc/passwd | /dev/null | /proc/self/environ | /proc/self/mem | /proc | /proc/self/cmdline
        /nope/nope | nope/nope.yaml | c.yaml/c.yaml | binary.yaml | list.yaml | empty.yaml | large.yaml | '' | 5 | ~
        [c.yaml] | "a\0b" | "\ud800" | http://127.0.0.1:9/x | file:///etc/passwd | '~/c.yaml' | $HOME | '*' | "a\nb"
        é.yaml
    """),
    *("0x" + "ff" * 2500, "xx" * 150, "x/" * 3000, "named-by-nobody\u202e.yaml"),
)

_KEY = re.compile(r"^(\s*(?:- )?[\w.]+:)[ \t]*(.*)$")


def bombs():
    """Texts that are small and would take long."""
    lists = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
    merges = "a0: &a0 {x0: 1}\n" + "".join(
        f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}], x{i}: 2}}\n" for i in range(1, 12)
    )
    wide = ("a: [" + "1," * 12_000 + "]", "".join(f"k{i}: 1\n" for i in range(2400)), "---\n" * 6000, "&a " * 3000)
    deep = ("- " * 5000 + "1", "? " * 5000 + "1", "[" * 5000, "{" * 5000, "a: " * 5000, "!!str " * 3000)
    stairs = ("".join(" " * i + "a:\n" for i in range(220)), "".join(f"{'  ' * i}- a:\n" for i in range(100)))
    long = ("a: " + "x" * 24_000, "#" * 26_000, "a: '" + "''" * 12_000 + "'", '"' + "\\x41" * 6000 + '"', "\n" * 24_900)
    return (lists, merges, *wide, *deep, *stairs, *long, "a: |\n" + " x\n" * 8000, "a: " + "9" * 24_000)


BOMBS = bombs()


def seeds():
    """Directories, relative to the configurations, and texts to start from."""
    configurations = ROOT / "configs"
    files = [configurations / "quickstart.yaml", *sorted(configurations.glob("paper/*.yaml"))]
    files += sorted(configurations.glob("machines/*.yaml"))
    found = [(path.parent.relative_to(configurations), path.read_text()) for path in files]
    return found + [(Path(), text) for text in EXTRA.values()]


def lay_out(place):
    """Copy the configurations to a directory, with files beside them that extend themselves or lead nowhere."""
    for path in (ROOT / "configs").rglob("*.yaml"):
        copy = place / path.relative_to(ROOT / "configs")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    for directory in (place, place / "paper", place / "machines"):
        (directory / "deep").mkdir()
        for name, target in (("link", "c"), ("dangling", "nowhere"), ("round", "round")):
            (directory / f"{name}.yaml").symlink_to(f"{target}.yaml")
        for name, other in (("loop-a", "loop-b"), ("loop-b", "deep/../loop-a")):
            (directory / f"{name}.yaml").write_text(f"extends: {other}.yaml\n")
        (directory / "binary.yaml").write_bytes(bytes(range(256)) * 4)
        (directory / "list.yaml").write_text("[1, 2]\n")
        (directory / "empty.yaml").write_text("")
        (directory / "large.yaml").write_text("# " + "x" * 30_000)


def spoiled(texts, seed, number):
    """Return the directory and the bytes of a spoiled file, the same for the same numbers."""
    random = np.random.default_rng([seed, number])
    place, text = texts[random.integers(len(texts))]
    lines = text.splitlines()
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        lines = _MUTATIONS[random.choice(len(_MUTATIONS), p=_SHARES)](lines, random)
    content = ("\n".join(lines) + "\n").encode("utf-8", errors="surrogatepass")
    if random.random() < 0.15:
        content = _BYTES[random.integers(len(_BYTES))](content, random)
    return place, content


def _pick(things, random):
    return things[random.integers(len(things))]


def _value(lines, random):
    """Put something else in the place of a value."""
    keys = [k for k, line in enumerate(lines) if _KEY.match(line)]
    if not keys:
        return [*lines, f"name: {_pick(VALUES, random)}"]
    k = _pick(keys, random)
    key = _KEY.match(lines[k])[1]
    return [*lines[:k], f"{key} {_pick(VALUES, random)}", *lines[k + 1 :]]


def _number(lines, random):
    """Change a number within a line, of a list too."""
    numbers = [(k, m) for k, line in enumerate(lines) for m in re.finditer(r"\d[\d.e+-]*", line)]
    if not numbers:
        return lines
    k, match = _pick(numbers, random)
    new = _pick(VALUES, random)
    if random.random() < 0.5:
        new = f"{10.0 ** random.uniform(-40, 40) * _pick((-1, 1), random):.3g}"
    return [*lines[:k], lines[k][: match.start()] + new + lines[k][match.end() :], *lines[k + 1 :]]


def _misspelt(lines, random):
    """Drop, double or swap a letter."""
    k = random.integers(len(lines) + 1)
    if k == len(lines) or not lines[k]:
        return lines
    line, at = lines[k], random.integers(len(lines[k]))
    new = _pick((line[:at] + line[at + 1 :], line[:at] + line[at] + line[at:], line[:at] + "x" + line[at:]), random)
    return [*lines[:k], new, *lines[k + 1 :]]


def _without(lines, random):
    k = random.integers(max(1, len(lines)))
    return [*lines[:k], *lines[k + 1 :]]


def _put_in(lines, random):
    at = random.integers(len(lines) + 1)
    return [*lines[:at], _pick(LINES, random), *lines[at:]]


def _named(lines, random):
    return [*(line for line in lines if not line.startswith("name")), f"name: {_pick(NAMES, random)}"]


def _extending(lines, random):
    return [f"extends: {_pick(BASES, random)}", *(line for line in lines if not line.startswith("extends"))]


def _bomb(lines, random):
    bomb = _pick(BOMBS, random)
    return [bomb] if random.random() < 0.5 else [*lines, bomb]


_SHARED = {_value: 6, _number: 5, _misspelt: 3, _without: 2, _put_in: 5, _named: 1.5, _extending: 2, _bomb: 0.2}
_MUTATIONS = tuple(_SHARED)
_SHARES = np.array([*_SHARED.values()]) / sum(_SHARED.values())


def _flipped(content, random):
    """Flip bits of some bytes."""
    changed = bytearray(content)
    for at in random.integers(len(changed), size=random.integers(1, 6)):
        changed[at] ^= 1 << random.integers(8)
    return bytes(changed)


def _cut(content, random):
    return content[: random.integers(len(content) + 1)]


def _foreign(content, random):
    """Put bytes in that are no text, or have another meaning."""
    at = random.integers(len(content) + 1)
    foreign = (b"\xed\xa0\x80", b"\xff\xfe", b"\x00", b"\x1b[2J", b"\xe2\x80\xae", b"\r", b"\x0c", b"\xf4\x90\x80\x80")
    return content[:at] + _pick(foreign, random) + content[at:]


def _recoded(content, random):
    text = content.decode("utf-8", errors="replace")
    coding = _pick(("utf-16", "utf-32", "utf-8-sig", "latin-1", "cp1252"), random)
    return text.replace("\n", _pick(("\n", "\r\n", "\r"), random)).encode(coding, errors="replace")


_BYTES = (_flipped, _cut, _foreign, _recoded)
