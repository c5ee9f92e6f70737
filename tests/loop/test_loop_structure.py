"""What ``symgen explain`` says of a loop, and that constants fold away."""

from __future__ import annotations

import pytest
import sympy as sp
from shared.loops import LOOPS, planar_4r, slider_crank
from typer.testing import CliRunner

from symgen.lowering.program import lower_system
from symgen.models.loop.structure import general, loop_structure
from symgen.models.loop.system import loop_system
from symgen.report.mathematics.saving import saving_lines


def operations(loop):
    """Of all kernels but the one that is called once per run."""
    program = lower_system(loop_system(loop))
    return sum(k.counts.flops for k in program.kernels if k is not program.setup)


def test_planar_loop_collapses_to_planar_code():
    """At least three times fewer operations than the same table with general offsets, in every main kernel."""
    special, whole = (lower_system(loop_system(x)) for x in (planar_4r(), general(planar_4r())))
    for name in ("position", "motion", "inverse", "outputs"):
        assert 3 * special.kernel(name).counts.flops <= whole.kernel(name).counts.flops, name
    assert 3 * operations(planar_4r()) <= operations(general(planar_4r()))


def test_planar_matrices_hold_only_planar_entries():
    system = loop_system(planar_4r())
    screws = system["screws"].matrix
    assert [tuple(screws[:, j]).count(0) >= 3 for j in range(4)] == [True] * 4
    assert all(x == 0 for x in [*screws[0, :], *screws[1, :], *screws[5, :]])
    functions = {f.func for d in system.definitions for f in d.expression.atoms(sp.Function)}
    assert functions <= {sp.sin, sp.cos}


@pytest.mark.parametrize("turns", range(1, 4))
def test_right_angles_fold_to_zeros_and_ones(turns):
    """A table with right angles has no constant but 0, 1 and -1 in its frames."""
    square = slider_crank(fixed={"alpha4": turns * sp.pi / 2, "a4": 0})
    system = loop_system(square)
    values = set(system["row_4_transform"].matrix[:, :3])
    assert values <= {sp.Integer(0), sp.Integer(1), sp.Integer(-1)}


def test_slider_crank_with_all_offsets_costs_less_than_asked():
    kernels = {k.name: k.counts.flops for k in lower_system(loop_system(slider_crank())).kernels}
    assert sum(kernels[k] for k in ("position", "motion", "inverse", "outputs")) < 700


def test_structure_names_rows_variables_and_what_is_left_out():
    loop = slider_crank()
    system = loop_system(loop)
    lines = list(loop_structure(loop, system))
    assert "  1 C, cylindric, from ground to crank: theta = theta1, S = S1, a = 12" in lines
    assert "  4 P, prismatic, from slider to ground: S = S4, alpha = alpha4, a = a4" in lines
    assert "prescribed: theta1, S1" in lines
    assert "to be found: theta2, eta2, theta3, eta3, alpha3, S4" in lines
    assert [line for line in lines if line.startswith("omitted: link rod:")]
    saved = list(saving_lines(system, loop_system(general(loop)), "general offsets"))
    assert saved[0] == (
        f"slider_crank: {operations(loop)} operations; with general offsets {operations(general(loop))} "
        f"({operations(general(loop)) / operations(loop):.1f} times)"
    )
    assert saved[1].split()[0] == "setup" and saved[1].endswith("once per run")
    assert saved[-1].startswith("code in C: ") and len(saved) == 3 + len(system.exports)


@pytest.mark.parametrize("name", LOOPS)
def test_general_table_is_the_same_table_at_its_own_values(name):
    loop = LOOPS[name]()
    wide = general(loop)
    for row, other in zip(loop.rows, wide.rows, strict=True):
        for entry in ("theta", "S", "eta", "alpha", "a"):
            back = getattr(other, entry).xreplace(dict(wide.defaults))
            assert sp.simplify(back - getattr(row, entry).xreplace(dict(loop.defaults))) == 0


def test_explain_shows_what_the_plane_saves():
    from symgen.cli import app

    done = CliRunner().invoke(app, ["explain", "planar_4r"])
    assert done.exit_code == 0, done.output
    line = next(x for x in done.output.splitlines() if "with general offsets" in x)
    assert float(line.rpartition("(")[2].split()[0]) >= 3
