"""The faults of benchmarks/mutations.py can be put in, and tests of their names are there."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_fault_replaces_one_piece_of_its_file(monkeypatch):
    spec = importlib.util.spec_from_file_location("table_of_faults", ROOT / "benchmarks" / "mutations.py")
    table = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, table)
    spec.loader.exec_module(table)
    assert len(table.FAULTS) >= table.FAULTS_WANTED
    for fault in table.FAULTS:
        text = (ROOT / "symgen" / "mechanics" / fault.file).read_text(encoding="utf-8")
        assert text.count(fault.old) == 1, fault.name
        assert fault.new != fault.old
        assert (ROOT / fault.test.partition("::")[0]).exists(), fault.test
