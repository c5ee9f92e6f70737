"""Repeats of a measurement: lines that are measured again, and the printed table."""

from __future__ import annotations

import json
import sys
from argparse import Namespace

import pytest


@pytest.fixture(scope="module")
def harness(load):
    return load("harness")


def asked(json=False, page=None):
    return Namespace(repeats=3, json=json, page=page)


def outcome(harness, capsys, ratios, errors=(1e-15,) * 9):
    """Return the exit code and the JSON of measurements with these ratios of times and errors, in this order."""
    values = iter(zip(*ratios, errors, strict=False))

    def measured():
        *times, error = next(values)
        lines = [harness.Required(f"ratio {k}", r, 5.0, True, timed=True) for k, r in enumerate(times)]
        lines.append(harness.Required("error", error, 1e-12, False))
        return harness.Measurement("title", [{"case": "a", "time": times[0]}], lines)

    code = harness.report_repeats(measured, asked(json=True))
    return code, json.loads(capsys.readouterr().out)


def test_tables_are_written_into_their_place_on_a_page(harness, capsys, monkeypatch, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "Before.\n<!-- other -->\n<!-- /other -->\n<!-- speed -->\nold\n<!-- /speed -->\nAfter.\n"
    )
    rows = [{"case": "a", "time [s]": 0.12345}, {"case": "b|c", "time [s]": None}]
    found = harness.Measurement("title", rows, [harness.Required("error", 1e-9, 1e-12, False)], ["A note."])
    monkeypatch.setattr(sys, "argv", ["benchmarks/speed.py"])
    for _ in range(2):
        assert harness.report_repeats(lambda: found, asked(page=page)) == 1
    head, _, rest = page.read_text().partition("<!-- speed -->\n")
    table, _, tail = rest.partition("<!-- /speed -->\n")
    assert (head, tail) == ("Before.\n<!-- other -->\n<!-- /other -->\n", "After.\n")
    assert "| case | time [s] |\n| --- | --- |\n| a | 0.123 |\n| b\\|c |  |\n" in table
    assert "| error | 1e-09 | <= 1e-12 | NO |" in table and "\n\nA note.\n\nMeasured on: " in table
    monkeypatch.setattr(sys, "argv", ["benchmarks/kernel.py"])
    with pytest.raises(SystemExit, match="has no place for kernel: write <!-- kernel -->"):
        harness.report_repeats(lambda: pytest.fail("measured"), asked(page=page))


def test_a_line_of_times_holds_when_one_repeat_holds(harness, capsys):
    code, found = outcome(harness, capsys, [[4.0, 6.0, 6.0]])
    assert code == 0
    assert found["required"][0]["values"] == [4.0, 6.0]
    assert [row["repeat"] for row in found["rows"]] == [1, 2]


def test_each_line_of_times_by_itself(harness, capsys):
    code, found = outcome(harness, capsys, [[4.0, 6.0], [6.0, 4.0]])
    assert code == 0
    assert [line["values"] for line in found["required"][:2]] == [[4.0, 6.0], [6.0, 4.0]]


def test_repeats_end_when_every_line_held_or_the_last_failed(harness, capsys):
    code, found = outcome(harness, capsys, [[6.0, 4.0]])
    assert code == 0 and found["required"][0]["values"] == [6.0]
    code, found = outcome(harness, capsys, [[4.0, 4.1, 4.2, 9.0]])
    assert code == 1 and found["required"][0]["values"] == [4.0, 4.1, 4.2]
    assert not found["required"][0]["holds"]


def test_a_line_that_is_no_time_must_hold_in_every_repeat(harness, capsys):
    code, found = outcome(harness, capsys, [[4.0, 6.0]], errors=(1e-11, 1e-15))
    assert code == 1
    assert found["required"][1] == {"name": "error", "values": [1e-11], "bound": 1e-12, "holds": False}
    code, found = outcome(harness, capsys, [[4.0, 6.0]], errors=(1e-15, float("nan")))
    assert code == 1 and found["required"][1]["values"] == [1e-15, None]


def test_the_table_lists_all_repeats(harness, capsys):
    ratios = iter([4.0, 4.5, 6.5])

    def measured():
        lines = [harness.Required("ratio", next(ratios), 5.0, True, timed=True)]
        return harness.Measurement("Speeds", [{"case": "a"}], lines)

    assert harness.report_repeats(measured, asked()) == 0
    text = capsys.readouterr().out
    assert "4, 4.5, 6.5" in text and "repeat 3" in text
