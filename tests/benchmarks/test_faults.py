"""The faults of benchmarks/mutations.py can be put in, and tests of their names are there."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_fault_replaces_one_piece_of_its_file(load):
    table = load("mutations")
    assert len(table.FAULTS) >= table.FAULTS_WANTED
    for fault in table.FAULTS:
        text = (ROOT / "symgen" / "mechanics" / fault.file).read_text(encoding="utf-8")
        assert text.count(fault.old) == 1, fault.name
        assert fault.new != fault.old
        assert (ROOT / fault.test.partition("::")[0]).exists(), fault.test
