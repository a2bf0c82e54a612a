"""Mutants follow the package."""

from tools.mutants import MUTANTS, files


def test_each_mutant_changes_one_place_of_the_package():
    texts = [file.read_text(encoding="utf-8") for file in files()]
    counts = {old: sum(text.count(old) for text in texts) for _, old, _ in MUTANTS}
    assert {old: count for old, count in counts.items() if count != 1} == {}
