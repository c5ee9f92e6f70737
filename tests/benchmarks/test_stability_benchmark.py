"""benchmarks/stability.py: the hard cases that it runs, its exit code, and docs/stability.md."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from shared.stability_case import Found, Outcome, Trial
from shared.stability_cases import CASES

from symgen.errors import ModelError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "stability.md"


@pytest.fixture(scope="module")
def stability(load):
    return load("stability")


def test_choosing(stability):
    assert stability.chosen([]) == CASES
    assert {c.family for c in stability.chosen(["loops"])} == {"loops"}
    assert [c.name for c in stability.chosen(["double_four_bar all round"])] == ["double_four_bar all round"]
    assert len(stability.chosen(["double_four_bar"])) == 4
    with pytest.raises(ModelError, match="there is no hard case 'bennet'.*Did you mean 'bennett'"):
        stability.chosen(["bennet"])


def test_the_page_is_of_these_cases():
    """Names, methods and bounds; numbers may differ in the last place between machines."""
    text = PAGE.read_text(encoding="utf-8")
    assert [line[4:] for line in text.splitlines() if line.startswith("### ")] == [c.name for c in CASES]
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| ") and "method" not in line]
    assert [row[1].strip() for row in rows] == [trial.label for case in CASES for trial in case.trials]
    assert not any("NOT" in line for line in text.splitlines())


def test_numbers_on_the_page(stability):
    """Rounded up to powers of ten, so that what did not change stays."""
    case = next(c for c in CASES if c.name == "mass_ratios")
    outcome = Outcome(case, Trial("dop853", {"rtol": 1e-9}, 1e-6), Found(2.1e-9, 3e-16, 1234, 1.0), "")
    row = next(line for line in stability.page([outcome]).splitlines() if line.startswith("| dop853"))
    assert row == "| dop853, rtol 1e-09 | yes | 1e-08 | round-off | 1200 | <= 1e-06 |"
    failed = stability.page([Outcome(case, Trial("rk4"), None, "it broke")])
    assert "| rk4 | **no** | - | - | - |  |" in failed and "*rk4*: it broke." in failed


def test_command(stability, tmp_path, capsys):
    file = tmp_path / "page.md"
    assert stability.main(["bennett", "planar_4r", "--out", str(file)]) == 0
    assert "### bennett" in file.read_text()
    shown = " ".join(capsys.readouterr().out.split())
    assert "cannot be followed beyond theta1 = -41.40962" in shown
    assert "2 of 3 rows have a bound" in shown


def test_command_fails_where_something_does_not_hold(stability, monkeypatch, capsys):
    case = next(c for c in CASES if c.name == "bennett")
    monkeypatch.setattr(stability, "CASES", (replace(case, bound=1e-30),))
    assert stability.main([]) == 1
    assert "Does not hold: bennett, pose by pose." in capsys.readouterr().out
