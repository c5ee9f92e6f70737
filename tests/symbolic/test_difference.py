"""What changed between two records: entries by what they are worth, not by how they are written."""

from __future__ import annotations

import pytest
import sympy as sp

from symgen.report.mathematics.difference import difference_lines
from symgen.symbolic.difference import difference
from symgen.symbolic.quantity import quantity
from symgen.symbolic.record import places, read_record, record
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

a, b, c = (quantity(name, "m", f"length {name}") for name in "abc")
d = quantity("d", "m", "what is shared")
x, y, z, shared = (s.symbol for s in (a, b, c, d))


def recorded(entries, *, shape=(2, 2), definition=x + y, operations=None, rows=("r", "s"), unit="m"):
    matrix = NamedMatrix("k", sp.ImmutableMatrix(*shape, entries), unit, "a matrix", rows, ())
    system = System(
        "m",
        "A model",
        (Group("q", "lengths", (a, b, c)),),
        (matrix,),
        (Export("k", "it", ("k",)),),
        (Definition(d, definition),),
    )
    return record("m", "A model", {"": system}, operations or {"k": 5})


def changes(before, after):
    return [(c.kind, c.place) for m in difference(before, after).matrices for c in m.changes]


PLAIN = [x, 0, x * y, shared]


def test_nothing_changed():
    found = difference(recorded(PLAIN), recorded(PLAIN))
    assert not found
    assert list(difference_lines(found)) == ["no change in the mathematics"]


@pytest.mark.parametrize(
    "entries, expected",
    [
        ([x, z, x * y, shared], [("added", "r, 1")]),
        ([0, 0, x * y, shared], [("removed", "r, 0")]),
        ([x, 0, x * y + z, shared], [("changed", "s, 0")]),
        ([x, 0, x * y * (1 + sp.Rational(1, 10**12)), shared], [("changed", "s, 0")]),
        ([x, 0, (x * y**2 + x * y * z) / (y + z), shared], [("rewritten", "s, 0")]),
        ([x, 0, x * y, x + y], [("rewritten", "s, 1")]),
    ],
)
def test_entries(entries, expected):
    assert changes(recorded(PLAIN), recorded(entries)) == expected


def test_a_shared_term_changes_the_entries_that_use_it():
    found = difference(recorded(PLAIN), recorded(PLAIN, definition=x - y))
    assert [(c.kind, c.before, c.after) for c in found.definitions] == [("changed", "a + b", "a - b")]
    assert changes(recorded(PLAIN), recorded(PLAIN, definition=x - y)) == [("changed", "s, 1")]
    assert "    d  (through shared terms)" in difference_lines(found)


def test_a_shared_term_written_otherwise_changes_no_entry():
    found = difference(recorded(PLAIN), recorded(PLAIN, definition=(x**2 - y**2) / (x - y)))
    assert found.definitions and not found.matrices


def test_shape_unit_and_operations():
    before = recorded(PLAIN, operations={"k": 5, "old": 2})
    after = recorded([x, 0, z, x * y, shared, 1], shape=(2, 3), unit="m^2", operations={"k": 7, "new": 1})
    found = difference(before, after)
    assert found.operations == {"k": (5, 7), "new": (None, 1), "old": (2, None)}
    assert found.totals == (7, 8)
    lines = list(difference_lines(found))
    assert lines[0].startswith("k (2 x 2, now 2 x 3): ")
    assert lines[1:4] == ["  changed [unit]", "    - m", "    + m^2"]
    assert lines[-4:] == [
        "  k                 5      7",
        "  new               -      1",
        "  old               2      -",
        "  all kernels       7      8",
    ]


def test_only_so_many_entries_are_shown():
    found = difference(recorded([0] * 4), recorded([x, y, z, x * y]))
    lines = list(difference_lines(found, 2))
    assert sum(line.startswith("  added") for line in lines) == 2
    assert "  ... and 2 entries more" in lines


def test_what_has_no_value_is_compared_as_text():
    assert changes(recorded([x, 0, 0, 1 / (x - x.func(x.name, real=True) + sp.zoo * 0 + y)]), recorded(PLAIN))
    pole = 1 / sp.Add(sp.log(x**2), -2 * sp.log(sp.Abs(x)), evaluate=False)
    before, same, other = recorded([pole, 0, 0, 0]), recorded([pole, 0, 0, 0]), recorded([pole * y, 0, 0, 0])
    assert not before.matrices["k"].values
    assert not difference(before, same)
    assert changes(before, other) == [("changed", "r, 0")]


def test_records_are_read_back():
    made = recorded(PLAIN)
    assert read_record(made.to_json()) == made
    for broken in ("", "[]", "{}", made.to_json().replace("rows", "lines")):
        with pytest.raises((KeyError, TypeError, ValueError)):
            read_record(broken)


def test_places_without_names_are_numbers():
    m = NamedMatrix("v", sp.ImmutableMatrix(2, 2, [1, 2, 3, 4]), "m", "no names", (), ("left", "right"))
    assert places(m) == ["0, left", "0, right", "1, left", "1, right"]
    assert places(NamedMatrix("v", sp.ImmutableMatrix(1, 1, [1]), "m", "one")) == ["0"]
