"""Every name that a derivation, a page or an error prints can be shown, of scenes and of building blocks."""

from __future__ import annotations

import re

import pytest
import sympy as sp
from shared.commands import call

import symgen
from symgen.errors import SymgenError
from symgen.lowering.kernel import SETUP
from symgen.lowering.program import lower_system
from symgen.models import BLOCKS, RECURSIONS
from symgen.pipeline.subject import Subject
from symgen.report.mathematics.record import record_in_text
from symgen.scene.loading import shipped_scenes
from symgen.symbolic.exact import Exact


@pytest.mark.parametrize(
    "name",
    ["four_bar", "slider_crank", "thesis_four_bar", "rocker_kinematics", "rod", "chain", "element_cubic"],
)
def test_every_printed_name_is_accepted(name):
    """Matrices with their prefixes, and names in the printed derivation: of matrices, shared terms, kernels."""
    changes = {"analysis.kind": "kinematics", "analysis.outputs": []} if name == "rocker_kinematics" else {}
    subject = Subject("crank_rocker" if changes else name, changes)
    listed = [prefix + m.name for prefix, part in subject.parts for m in part.matrices]
    steps = subject.record
    text = record_in_text(steps)
    printed = [m.name for step in steps for m in step.matrices]
    assert all(f"{name}:" in text for name in printed)
    terms = [d.quantity.name for step in steps for d in step.system.definitions]
    terms += [d.quantity.name for _, part in subject.parts for d in part.definitions]
    arguments = [x.name for _, part in subject.parts for g in part.groups for x in g.quantities]
    kernels = [k.name for k in lower_system(subject.system).kernels if k.name != SETUP]  # no mathematics
    for each in dict.fromkeys([*listed, *printed, *terms, *arguments, *kernels]):
        chosen = subject.choose(each)
        assert chosen.matrices
        known = {x.symbol for x in chosen.system.quantities()}
        assert all(m.matrix.free_symbols <= known for m in chosen.matrices)


def test_equations_of_a_model_know_every_name():
    equations = symgen.build("four_bar").equations
    system = symgen.derive("four_bar")
    assert [*equations] == [m.name for m in system.matrices]  # iteration derives nothing further
    masses = equations["particle_masses"]
    assert masses.shape == (3, 3) and sum(masses) == sum(equations["end_masses"][:, 0]) + sum(
        equations["end_masses"][:, 2]
    ) + 2 * sum(equations["end_masses"][:, 1])
    assert equations["momentum_rows.crank_moment"].shape == (1, 1)
    definition = next(d for d in system.definitions if d.expression.args)
    assert equations[definition.quantity.name] == sp.Matrix([[definition.expression]])
    elastic = symgen.build("thesis_four_bar").equations
    assert elastic["elastic_joints.mass_matrix"].rows and elastic["weak_form"].rows
    with pytest.raises(SymgenError, match=r"stands for \d+ matrices: crank_moment, .*name one of them"):
        equations["momentum_rows"]


def test_an_unknown_name_is_answered_by_the_nearest_ones():
    with pytest.raises(SymgenError, match="Did you mean 'mass_matrix'") as close:
        call("show", "peaucellier", "mass_matrx")
    with pytest.raises(SymgenError, match="The nearest of [0-9]+ names are ") as far:
        call("show", "peaucellier", "qqqq")
    for error in (close, far):
        assert len(str(error.value)) < 300 and "symgen show peaucellier lists" in str(error.value)


def test_all_that_can_be_shown_is_listed():
    listed = call("show")
    for name in (*shipped_scenes(), *BLOCKS, *RECURSIONS):
        assert re.search(rf"^{name}\s+\S", listed, re.MULTILINE), name
    assert "symgen show my_linkage.toml" in listed
    assert "particle_masses" in call("show", "four_bar")


@pytest.mark.parametrize("name", BLOCKS)
def test_blocks_are_derived_in_python(name, request):
    if name not in ("rod", "loop_row", "chain", "chain_spatial", "element_cubic", "synthesis_dyad"):
        assert BLOCKS[name].about  # their derivation is tested elsewhere
        return
    system = symgen.derive(name)
    assert system.name == name and system.matrices


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_chain_as_one_system_is_its_steps(dimension):
    """Every matrix of a step, at random values, has the value of that step alone."""
    name = "chain" if dimension == 2 else "chain_spatial"
    whole = symgen.derive(name)
    values = {x.name: sp.Rational(k + 3, 7) for k, x in enumerate(whole.group("p").quantities)}
    exact = Exact(whole)
    for step in RECURSIONS[name]().steps:
        own = {
            g.name: [values.get(f"{x.name}_{step.name}", values.get(x.name)) for x in g.quantities]
            for g in step.groups
        }
        for m in step.matrices:
            found = exact.matrix(f"{step.name}.{m.name}", {"p": list(values.values())})
            assert [*found] == pytest.approx([*Exact(step).matrix(m.name, own)], rel=1e-25)


def test_blocks_have_reports_differences_and_accuracy(tmp_path):
    page = tmp_path / "rod.html"
    call("report", "rod", "--out", page)
    text = page.read_text()
    assert "particle_masses" in text and "symgen.derive(&#34;rod&#34;)" in text
    assert "length.gamma (1 x 1): 1 changed" in call("diff", "chain", "chain_spatial")
    assert max(map(len, call("diff", "element_beam8", "element_beam9").splitlines())) <= 100
    assert "inward.factors" in call("accuracy", "chain", "--states", "1")
    with pytest.raises(SymgenError, match="no scene: it has no values to set"):
        call("report", "rod", "--set", "m=2", "--out", page)
