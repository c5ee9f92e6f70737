"""The analyses' own kernels against 30-digit evaluation, and their commands."""

from __future__ import annotations

import json

import mpmath
import numpy as np
import pytest
from shared.full import full_unless
from shared.oracle import DIGITS, Oracle, relative_error
from shared.rich_scenes import SCENES
from shared.shipped import ELASTIC, IN_SPACE, derived, rigid
from shared.states import values_of
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SymgenError
from symgen.models.analyses import ANALYSES, analysis_system
from symgen.pipeline.build import check_scene, text_of
from symgen.scene.resolve import resolve

runner = CliRunner()


#: Kernels of elastic links are derived only for planar scenes that have elastic links.
BENDING = {*ELASTIC} - {*IN_SPACE}
KERNELS = [(s, k) for s in SCENES for k in ANALYSES if s in BENDING or not k.startswith("elastic")]
#: Kernels with the derivatives of those of others by all arguments: large ones.
SLOPES = ("linearisation", "sensitivity", "variation", "vibration")
#: A crank that is held, and one with a motor.
ELASTIC_KINDS = ("elastic_slider_crank", "elastic_four_bar_motor")


@pytest.mark.parametrize(
    ("scene", "kind", "backend"),
    full_unless(
        lambda scene, kind, backend: (
            (scene in ("double_four_bar", "tumbling_body") and backend == "c")
            if kind in SLOPES
            else scene == "loaded"
            or (backend == "c" and scene in ("peaucellier", "tumbling_body", *ELASTIC_KINDS))
        ),
        [(*kernel, backend) for kernel in KERNELS for backend in ("c", "numpy")],
    ),
)
def test_kernels_of_the_analyses(scene, kind, backend):
    scene = SCENES[scene]()
    model = rigid(symgen.build(scene, backend=backend))
    linkage = resolve(check_scene(text_of(scene)))
    if kind == "forces" and linkage.dimension == 3:
        with pytest.raises(SymgenError, match="forces by elements are for linkages in the plane"):
            analysis_system(linkage, kind)
        return
    system = analysis_system(linkage, kind)
    oracle, kernels = Oracle(system), model.analysis(kind, outputs=tuple(linkage.outputs or ()))
    rng = np.random.default_rng(3)
    for _ in range(2):
        values = values_of(model, system, rng)
        work = np.append(values["work"], np.zeros(kernels.work_size + 1))
        for export in system.exports:
            found = kernels.blocks(export.kernel, values["t"][0], values["q"], values["u"], work.copy())
            truth = oracle.matrices(export.matrices, values)
            for name, exact in zip(export.matrices, truth, strict=True):
                assert relative_error(np.ravel(found[name]), exact) < 1e-13, name


@pytest.mark.parametrize("scene", ["peaucellier", "four_bar", "loaded"])
def test_stiffness_and_damping_are_slopes_of_the_equations_of_motion(scene):
    """Differences at 30 digits of f - J^T lambda, as the equations of motion themselves have them."""
    scene = SCENES[scene]()
    model = symgen.build(scene)
    dynamics = derived(scene).in_numbers()
    system = analysis_system(resolve(check_scene(text_of(scene))), "statics")
    values = values_of(model, dynamics, np.random.default_rng(5))
    n = len(values["q"])
    if scene != "peaucellier":
        values["t"][:] = 0.0
    symbols = [x.symbol for g in dynamics.groups for x in g.quantities]
    import sympy as sp

    force, jacobian = (
        sp.lambdify(symbols, sp.Matrix(dynamics.expanded(name)), modules="mpmath")
        for name in ("force", "constraint_jacobian")
    )
    order = [g.name for g in dynamics.groups]

    def left(q, u):
        arrays = {**values, "q": q, "u": u}
        with mpmath.workdps(DIGITS):
            arguments = [
                x if isinstance(x, mpmath.mpf) else mpmath.mpf(float(x)) for k in order for x in arrays[k]
            ]
            multipliers = mpmath.matrix([mpmath.mpf(float(x)) for x in values["work"][n:]])
            return force(*arguments) - jacobian(*arguments).T * multipliers

    own = Oracle(system)
    names = [x.name for x in system.group("q").quantities]
    step = mpmath.mpf(10) ** -10
    for matrix, vary in (("stiffness", "q"), ("damping", "u")):
        exact = np.zeros((n, n))
        for j in range(n):
            sides = []
            for sign in (1, -1):
                with mpmath.workdps(DIGITS):
                    moved = [mpmath.mpf(float(x)) for x in values[vary]]
                    moved[j] += sign * step
                sides.append(left(**{"q": values["q"], "u": values["u"], vary: moved}))
            with mpmath.workdps(DIGITS):
                exact[:, j] = [float(-(a - b) / (2 * step)) for a, b in zip(*sides, strict=True)]
        dense = np.zeros((n, n))
        if matrix in system:
            listed = own.matrix(matrix, values)
            for row, value in zip(system[matrix].rows, listed, strict=True):
                a, b = row.split()
                dense[names.index(a), names.index(b)] = float(value)
        assert np.max(np.abs(dense - exact)) <= 1e-13 * max(np.max(np.abs(exact)), 1e-300), matrix


def call(*arguments):
    done = runner.invoke(app, [*map(str, arguments)], catch_exceptions=True)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout


def test_commands_print_one_object(tmp_path):
    found = json.loads(
        call("kinematics", "crank_rocker", "--to", 0.5, "--samples", 11, "--of", "B", "--json")
    )
    assert found["kind"] == "kinematics" and found["coordinate"]["count"] == 11
    of_point = {f"B.{what}.{axis}" for what in ("position", "velocity", "acceleration") for axis in "xy"}
    assert set(found["outputs"]) == {"crank.angle", *of_point}
    other = json.loads(
        call("kinematics", "crank_rocker", "--to", 0.5, "--samples", 11, "--of", "B", "--state", 2, "--json")
    )
    assert other["final"]["B"]["position"][1] < 0 < found["final"]["B"]["position"][1]
    found = json.loads(call("equilibrium", "four_bar", "--json"))
    assert found["stability"] == "stable" and found["residual"] < 1e-13 * found["largest_force"]
    found = json.loads(call("modes", "triple_pendulum", "--json"))
    assert len(found["modes"]) == 3 and found["stable"] and found["equilibrium"]["freedoms"] == 3


def test_commands_print_tables_and_save(tmp_path):
    shown = call(
        "kinematics",
        "crank_rocker",
        "--samples",
        9,
        "--out",
        tmp_path / "k.npz",
        "--plot",
        tmp_path / "k.svg",
    )
    assert "rocker.rate" in shown and "constraints met within" in shown
    assert (
        len(symgen.load_result(tmp_path / "k.npz").time) == 9 and (tmp_path / "k.svg").stat().st_size > 1000
    )
    assert "stable equilibrium, 1 degree of freedom" in " ".join(call("equilibrium", "four_bar").split())
    assert "1 mode about a stable equilibrium" in " ".join(call("modes", "four_bar").split())
    shown = call("modes", "triple_pendulum")
    assert "frequency" in shown and "oscillation" in shown


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["kinematics", "four_bar"], "needs 1 more drive"),
        (["kinematics", "four_bar", "--state", "2"], "needs 1 more drive"),
        (["kinematics", "crank_rocker", "--state", 3], "expected --state from 1 to 2"),
        (["kinematics", "crank_rocker", "--from", 2], "start before stop"),
        (["equilibrium", "crank_rocker"], "no equilibrium while a drive is in motion"),
        (["equilibrium", "crank_rocker"], '--set drivers.0.angle="30 deg"'),
        (["modes", "crank_rocker"], "no equilibrium while a drive is in motion"),
        (["equilibrium", "four_baar"], "Did you mean 'four_bar'"),
    ],
)
def test_commands_refuse_with_one_message(arguments, words):
    done = runner.invoke(app, [*map(str, arguments)])
    assert isinstance(done.exception, SymgenError) and words in str(done.exception)
