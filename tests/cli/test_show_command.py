"""The command ``show``: matrices, steps of derivations, numbers at the start."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from shared.commands import call
from shared.shipped import derived

from symgen.errors import SymgenError


@pytest.mark.parametrize("model", ["four_bar", "rod"])
def test_show(model):
    listed = call("show", model)
    assert "mass_matrix" in listed and "constraint_jacobian" in listed
    assert "⎡" in call("show", model, "mass_matrix")
    assert r"\begin{matrix}" in call("show", model, "constraint_jacobian", "--format", "latex")
    assert "out[0] = " in call("show", model, "constraint_jacobian", "--format", "c")


@pytest.mark.parametrize("model", ["peaucellier", "slider_crank"])
def test_every_listed_matrix_is_shown(model):
    """Names with dots too, as outputs have."""
    names = [m.name for m in derived(model).matrices]
    assert any("." in name for name in names)
    for name in (names[0], *[name for name in names if "." in name][:3]):
        assert call("show", model, name, "--format", "c")


def test_show_lists_the_steps_of_a_derivation():
    listed = call("show", "element_beam8")
    assert listed.index("weak_form") < listed.index("geometric0") < listed.index("global_stiffness")
    assert "(6.12); rotary" in listed and listed.count("per angle") == 3  # once for each table
    assert "u̇ + v_x" in call("show", "element_cubic", "velocity")
    assert "mass matrix" in call("show", "element_timoshenko", "mass")


def test_show_says_what_rows_and_symbols_are():
    shown = call("show", "element_beam8", "load_x")
    beside = [line.split()[0] for line in shown.splitlines() if re.match(r"\w+ +[⎡⎢⎣]", line)]
    assert beside == ["u1", "w1", "theta1", "kappa1", "u2", "w2", "theta2", "kappa2"]
    assert "L   length of the element [m]" in shown and "m2  mass per length" in shown
    assert "j0" not in shown  # only what stands there


def test_show_lists_what_elastic_links_take():
    listed = call("show", "thesis_four_bar")
    assert (
        listed.index("mass_matrix")
        < listed.index("elastic_motion.links")
        < listed.index("elastic_joints.load")
    )
    text = call("show", "thesis_four_bar", "elastic_motion.links", "--format", "numeric")
    crank = next(line for line in text.splitlines() if line.startswith("  crank"))
    cosine, sine, gyroscopic = (float(x) for x in crank.split()[1:4])
    assert cosine == 1.0 and abs(sine) < 1e-15
    assert gyroscopic == pytest.approx(-2 * 373 * math.pi / 30, rel=1e-9)
    assert "out[0] = " in call("show", "thesis_four_bar", "elastic_joints.mass_matrix", "--format", "c")
    assert "elastic_motion" not in call("show", "four_bar")


def test_show_numbers_at_the_start():
    text = call("show", "four_bar", "positions", "--format", "numeric")
    rows = {line.split()[0]: [float(x) for x in line.split()[1:]] for line in text.splitlines()[2:]}
    assert rows["A"] == pytest.approx([np.cos(1.1), np.sin(1.1)], abs=1e-10)
    with pytest.raises(SymgenError, match="no state"):
        call("show", "rod", "mass_matrix", "--format", "numeric")
    plain = call("show", "element_beam8", "mode_conditions", "--format", "numeric", "--rows", "1")
    assert float(plain.split()[-1]) == 1.0  # it has no symbols
    with pytest.raises(SymgenError, match="no format 'tex'"):
        call("show", "rod", "mass_matrix", "--format", "tex")
