"""Every answer of the cookbook runs: blocks of Python after its opening lines, commands one after the other."""

import re
import shlex
import shutil

import pytest
from common import commands
from common.places import ROOT

COOKBOOK = (ROOT / "results/cookbook.md").read_text(encoding="utf-8")
OPENING, *SECTIONS = re.split(r"^## ", COOKBOOK, flags=re.MULTILINE)
BLOCK = re.compile(r"```(python|console)\n(.*?)```", re.DOTALL)
ANSWERS = {title: BLOCK.findall(rest) for title, _, rest in (section.partition("\n") for section in SECTIONS)}
#: Answers that take seconds.
LONG = {
    "How fast does it convey, and how steeply?",
    "Start, operation, stop",
    "One motor fails in operation",
    "The least power for an amplitude",
    "Tolerances",
    "Compare with measurements",
    "What the machine really is",
    "Acceleration and its spectrum",
    "Springs for a force",
    "A spring breaks",
    "Is it accurate?",
    "Excel, MATLAB",
    "Progress in a notebook",
    "A law of one's own",
    "A film for a talk",
}
#: Answers that take half a minute and more.
SLOW = {"The machine shakes sideways", "The smallest motor that starts"}


@pytest.fixture(scope="module")
def begun(tmp_path_factory, kernels):
    """A directory with the screen and its run, and the configurations of a clone."""
    place = tmp_path_factory.mktemp("cookbook")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        assert commands.command("new", "screen.yaml", "--template", "screen").code == 0
        text = (place / "screen.yaml").read_text(encoding="utf-8")
        quick = text.replace("duration_s: 20,", "duration_s: 3,").replace("step: 1,", "step: 25,")
        assert quick != text
        (place / "screen.yaml").write_text(quick, encoding="utf-8")
        assert commands.command("run", "screen.yaml").code == 0
    (place / "configs").symlink_to(ROOT / "configs")
    return place


def test_answers_are_short():
    assert len(ANSWERS) >= 13
    assert all(ANSWERS.values())
    texts = (text for blocks in ANSWERS.values() for _, text in blocks)
    assert max(len([line for line in text.splitlines() if line]) for text in texts) <= 6


@pytest.mark.parametrize(
    "title",
    [
        pytest.param(title, marks=(pytest.mark.long,) * (title in LONG) + (pytest.mark.campaign,) * (title in SLOW))
        for title in ANSWERS
    ],
)
def test_an_answer_runs(title, begun, command, tmp_path, monkeypatch):
    shutil.copytree(begun, tmp_path / "copy", symlinks=True)
    monkeypatch.chdir(tmp_path / "copy")
    known = {}
    exec(BLOCK.search(OPENING)[2], known)
    for language, text in ANSWERS[title]:
        if language == "python":
            exec(text, known)
            continue
        for line in text.splitlines():
            _, program, *arguments = shlex.split(line)
            done = command(*arguments)
            assert (program, done.code, done.err) == ("vibroplat", 0, ""), line
