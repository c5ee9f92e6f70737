"""What changed between two records: entries by what they are worth, not by how they are written."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import sympy as sp

from symgen.regeneration.generate import Regenerated
from symgen.regeneration.sources import compare, systems
from symgen.report.mathematics.difference import difference_lines
from symgen.report.mathematics.regeneration import regenerated_lines
from symgen.symbolic.difference import difference
from symgen.symbolic.quantity import quantity
from symgen.symbolic.record import EntryValues, places, read_record, record
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
    assert "    d  (through d)" in difference_lines(found)


def with_terms(matrices, definitions):
    """Return the record of matrices by name, and of shared terms by name in the order of their use."""
    terms = tuple(Definition(quantity(n, "m", f"term {n}"), e) for n, e in definitions.items())
    made = tuple(NamedMatrix(n, sp.ImmutableMatrix(m), "m", "a matrix") for n, m in matrices.items())
    group = Group("q", "lengths", (a, b, c))
    return record("m", "A model", {"": System("m", "A model", (group,), made, (), terms)}, {})


def test_what_a_change_through_shared_terms_comes_from():
    e, f, g = (quantity(n, "m", f"term {n}").symbol for n in "efg")
    matrices = {"k": [[g, e], [f, x]]}
    before = with_terms(matrices, {"e": x + y, "f": y * z, "g": e * f + x})
    after = with_terms(matrices, {"e": x - y, "f": y * z, "g": e * f + x})
    (matrix,) = difference(before, after).matrices
    assert [(c.place, c.through) for c in matrix.changes] == [("0, 0", ("e",)), ("0, 1", ("e",))]
    both = with_terms(matrices, {"e": x - y, "f": y * z, "g": e * f + y})
    (matrix,) = difference(before, both).matrices
    assert [(c.place, c.through) for c in matrix.changes] == [("0, 0", ("g", "e")), ("0, 1", ("e",))]
    assert "    g  (through g, e)" in difference_lines(difference(before, both))


def test_terms_of_another_system_are_no_cause():
    e = quantity("e", "m", "term e")

    def made(first, second):
        systems = {
            prefix: System(
                "m",
                "A model",
                (Group("q", "lengths", (a, b, c)),),
                (NamedMatrix("k", sp.ImmutableMatrix([[e.symbol]]), "m", "a matrix"),),
                (),
                (Definition(e, term),),
            )
            for prefix, term in (("", first), ("further.", second))
        }
        return record("m", "A model", systems, {})

    (matrix,) = difference(made(x + y, x * y), made(x - y, x * y)).matrices
    assert (matrix.name, matrix.changes[0].through) == ("k", ("e",))
    (matrix,) = difference(made(x + y, x * y), made(x + y, x / y)).matrices
    assert (matrix.name, matrix.changes[0].through) == ("further.k", ("e",))


def test_an_argument_of_another_system_is_none_of_the_shared_terms():
    """A further system without shared terms has an argument d; the main system a shared term of this name."""
    square = NamedMatrix("k", sp.ImmutableMatrix([[shared**2]]), "m", "a square")
    own = System("f", "Other", (Group("q", "lengths", (d,)),), (square,), ())

    def made(term):
        main = NamedMatrix("k", sp.ImmutableMatrix([[shared]]), "m", "a matrix")
        terms = (Definition(d, term),)
        first = System("m", "A model", (Group("q", "lengths", (a, b, c)),), (main,), (), terms)
        return record("m", "A model", {"": first, "further.": own}, {})

    assert [m.name for m in difference(made(x + y), made(x - y)).matrices] == ["k"]


def test_the_base_of_exponentials_is_not_a_modulus():
    modulus = quantity("E", "Pa", "modulus")
    group = Group("q", "values", (modulus,))
    entries = sp.ImmutableMatrix([[modulus.symbol, sp.E * modulus.symbol]])
    system = System("m", "A model", (group,), (NamedMatrix("k", entries, "Pa", "it"),), ())
    first, second = map(float, EntryValues(record("m", "A model", {"": system}, {})).of("k").values())
    assert second / first == pytest.approx(math.e, rel=1e-15)


@pytest.mark.parametrize("factor", [sp.Rational(1, 2), -1, 12, sp.Rational(-127, 5000), 10**9])
def test_one_factor_of_all_entries(factor):
    first, second = sp.Matrix([[x, y / 3], [0, x * y + z]]), sp.Matrix([[y, z], [0, x / 7]])
    before = with_terms({"g0": first, "g1": second, "g2": second.T, "h": first}, {})
    after = with_terms({"g0": factor * first, "g1": factor * second, "g2": factor * second.T, "h": first}, {})
    found = difference(before, after)
    assert [(m.name, m.factor, m.whole) for m in found.matrices] == [
        (f"g{k}", str(factor), True) for k in range(3)
    ]
    lines = list(difference_lines(found))
    assert lines[:2] == [f"g0 to g2: all entries times {factor}", f"g0 (2 x 2): all entries times {factor}"]
    assert sum(line.startswith("  changed") for line in lines) == 9


@pytest.mark.parametrize(
    "entries, said",
    [
        ([3 * x, 0, x * y, 3 * shared], "2 changed (times 3)"),
        ([3 * x, z, 3 * x * y, 3 * shared], "1 added, 3 changed (times 3)"),
        ([3 * x, 0, 3 * x * y, 2 * shared], "3 changed"),
        ([x * z, 0, x * y * z, shared * z], "3 changed"),  # no number
        ([3 * x, 0, 3 * x * y, 3 * (1 + sp.Rational(1, 10**14)) * shared], "3 changed"),
    ],
)
def test_a_factor_is_said_only_of_what_it_covers(entries, said):
    assert next(difference_lines(difference(recorded(PLAIN), recorded(entries)))) == f"k (2 x 2): {said}"


def test_equal_changes_are_listed_once():
    before = with_terms({"left": [[x, 0], [0, x]], "right": [[x, 0], [0, x]], "other": [[x, 0], [0, y]]}, {})
    new = [[x + y, 0], [0, x + y]]
    after = with_terms({"left": new, "right": new, "other": [[x + y, 0], [0, x + y]]}, {})
    assert list(difference_lines(difference(before, after))) == [
        "left and right (2 x 2): 2 changed",
        "  changed [0, 0] and [1, 1]",
        "    - a",
        "    + a + b",
        "other (2 x 2): 2 changed",
        "  changed [0, 0]",
        "    - a",
        "    + a + b",
        "  changed [1, 1]",
        "    - b",
        "    + a + b",
    ]


def test_equal_changes_of_several_models_are_listed_once():
    first, second = (
        difference(recorded(PLAIN, operations={"k": n}), recorded([2 * x, 0, 2 * x * y, 2 * shared]))
        for n in (5, 7)
    )
    other = difference(recorded(PLAIN), recorded([2 * x, 0, 3 * x * y, 2 * shared]))
    made = Regenerated({}, (), {"beam": first, "stub": other, "frame": second, "new": None})
    assert list(regenerated_lines(made, 1)) == [
        "new: no record of its mathematics before",
        "beam and frame:",
        "  k (2 x 2): all entries times 2",
        "    changed [r, 0]",
        "      - a",
        "      + 2*a",
        "    ... and 2 entries more",
        "  operations of frame, before and after:",
        "    k                 7      5",
        "    all kernels       7      5",
        "stub:",
        "  k (2 x 2): 3 changed",
        "    changed [r, 0]",
        "      - a",
        "      + 2*a",
        "    ... and 2 entries more",
        "generated/ is current",
    ]


def test_differences_of_scenes():
    """Half the geometric stiffness of an element, and a crank without its length."""
    element = systems("element_cubic").all[""]
    halved = [
        replace(m, matrix=m.matrix / 2) if m.name.startswith("geometric") else m for m in element.matrices
    ]
    two = (replace(element, matrices=tuple(m)) for m in (element.matrices, halved))
    before, after = (record("e", "An element", {"": s}, {}) for s in two)
    lines = list(difference_lines(difference(before, after)))
    assert lines[0] == "geometric0 to geometric2: all entries times 1/2"

    _, _, found = compare("slider_crank", "slider_crank", {"a1": "0 in"})
    causes = {(m.name, c.place): c.through for m in found.matrices for c in m.changes}
    assert causes["closure_defect", "x, p"] == ("p_a2_x", "p_a1_x")
    assert causes["closure_jacobian", "vx, eta3"] == ("p_a2_y", "p_a1_y")
    assert all(c.through for m in found.matrices for c in m.changes if c.through_shared_terms)
    assert not any("(through shared terms)" in line for line in difference_lines(found))


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
    assert not EntryValues(before).of("k")
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


@pytest.mark.parametrize(
    ("entries", "summary"),
    [
        (PLAIN, "other unit"),
        ([2 * x, 0, 2 * x * y, shared], "2 changed (times 2), other unit"),
        ([2 * x, 0, 2 * x * y, 2 * shared], "all entries times 2, other unit"),
    ],
)
def test_a_unit_is_no_entry(entries, summary):
    lines = list(difference_lines(difference(recorded(PLAIN), recorded(entries, unit="mm"))))
    assert lines[0] == f"k (2 x 2): {summary}"
