"""Expressions read back from records: the same to the letter, and nothing is run."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp

from symgen.symbolic.reading import expression
from symgen.symbolic.record import read_record

GENERATED = Path(__file__).parents[2] / "generated"


@pytest.mark.parametrize("model", ["peaucellier", "chain_spatial", "slider_crank", "loop_row"])
def test_every_entry_of_a_record_comes_back_to_the_letter(model):
    kept = read_record((GENERATED / f"{model}_equations.json").read_text(encoding="utf-8"))
    texts = [*kept.definitions.values(), *(e for m in kept.matrices.values() for e in m.entries.values())]
    assert len(texts) > 10
    for text in texts:
        assert sp.sstr(expression(text)) == text


x, y = sp.symbols("x y")


@pytest.mark.parametrize(
    "expected",
    [2 * (x + y), -(x + y) * sp.pi, sp.Piecewise((x, x < 1), (sp.atan2(y, x), True)), sp.Float("0.25") * x]
    + [sp.Rational(-2, 25), sp.sqrt(sp.Abs(x)), sp.Function("mine")(x, y), sp.Max(x, y)],
)
def test_forms(expected):
    assert sp.sstr(expression(sp.sstr(expected))) == sp.sstr(expected)


@pytest.mark.parametrize(
    "text", ["", "0.2 m", "m^2", "x[0]", "x.y", "[x]", "lambda: 1", "f(x=1)", "'x'", "(" * 400]
)
def test_what_is_no_expression(text):
    assert expression(text) is None


def test_nothing_is_run(tmp_path):
    made = expression(f"open({1}, 2)")  # a function of that name
    assert made == sp.Function("open")(1, 2)
    assert expression(f"open('{tmp_path / 'x'}', 'w')") is None
    assert not list(tmp_path.iterdir())
