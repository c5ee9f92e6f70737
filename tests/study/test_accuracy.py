"""The error report of kernels: what it must find, and that it says nothing else."""

from __future__ import annotations

import json
import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from shared.commands import call
from shared.full import full
from shared.shipped import derived

from symgen.errors import BuildError, ModelError, ResultError, SceneError
from symgen.lowering.program import lower_system
from symgen.lowering.tape import Tape
from symgen.study.accuracy.accuracy import Accuracy, accuracy, report
from symgen.study.accuracy.kernels import ComparedKernels
from symgen.study.accuracy.states import At, States, of_block
from symgen.symbolic.exact import DIGITS, Exact
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

X, Y = (quantity(name, "1", f"the number {name}") for name in "xy")
x, y = X.symbol, Y.symbol


def system(*entries, definitions=()):
    """One kernel 'f' with a matrix 'f' over x and y."""
    matrix = NamedMatrix("f", sp.ImmutableMatrix(len(entries), 1, entries), "1", "what is looked at")
    return System(
        "planted",
        "A planted fault",
        (Group("q", "numbers", (X, Y)),),
        (matrix,),
        (Export("f", "what is looked at", ("f",)),),
        tuple(Definition(quantity(n, "1", f"the number {n}"), e) for n, e in definitions),
    )


def rounded(made: System, **wrong):
    """The kernel of a system in Python's own doubles, from its printed program."""
    from symgen.codegen.printers import Printer

    (kernel,) = lower_system(made).kernels
    printer = Printer({})

    def run(_, arrays):
        known = {"q": arrays["q"].tolist(), "sin": math.sin, "cos": math.cos}
        for a in kernel.assignments:
            known[a.target] = eval(printer(a.value), {}, known)
        out = [eval(printer(s.value), {}, known) for s in kernel.stores]
        return np.array(out) * wrong.get("times", 1.0)

    return run


def looked(made: System, *states, call=None):
    places = States(tuple(At("open", f"open {i}", {"q": np.array(q)}) for i, q in enumerate(states)))
    return report("planted", made.title, [ComparedKernels("", made, call or rounded(made), places)])


def test_a_planted_cancellation_is_found_and_ranked_first():
    shifted = sp.Symbol("shifted", real=True)
    made = system((shifted - 10**8) * sp.sin(y) + y * x, definitions=(("shifted", x + 10**8),))
    found = looked(made, (1.3, 0.7), (0.7, 2.8))
    first = found.cancelling[0]
    assert "shifted" in first.expression and "100000000.0" in first.expression
    assert first.digits == pytest.approx(8.4, abs=0.4) and first.needless > 7
    (output,) = found.outputs
    assert output.beyond > 1e6 and output.verdict == "code"


def test_a_cancellation_of_the_problem_is_told_from_one_of_the_code():
    (found,) = looked(system(x * y - 1), (1.3, 0.7692307)).cancelling
    assert found.expression == "x*y - 1.0"
    assert found.digits == pytest.approx(7.4, abs=0.5)
    assert found.needless == pytest.approx(0.0, abs=0.1)


def test_what_the_condition_explains_is_the_problems_own():
    (output,) = looked(system(sp.cos(x) * y - sp.sin(x)), (0.785398163, 1.0)).outputs
    assert output.verdict == "problem"
    assert output.worst.ulps > 1e6 and output.beyond < 2
    assert output.worst.condition == pytest.approx(
        (0.785398163 * math.sqrt(2) + math.sqrt(0.5)) / abs(output.worst.exact), rel=1e-6
    )


def test_a_sound_kernel_has_no_fault():
    (output,) = looked(system(x * y + sp.sin(y)), (1.3, 0.7), (2.0, 0.1)).outputs
    assert output.verdict == "" and output.worst.ulps < 3


def test_a_wrong_constant_is_caught():
    """A third in single precision: the kernel computes something else, and the report says so."""
    made = system(x * y / 3)
    assert looked(made, (1.3, 0.7)).outputs[0].verdict == ""
    third = float(np.float32(1 / 3)) * 3
    (output,) = looked(made, (1.3, 0.7), call=rounded(made, times=third)).outputs
    assert output.verdict == "code"
    assert output.worst.relative == pytest.approx(third - 1, rel=1e-6)


def test_zeros_and_small_entries_are_told_apart():
    made = system(x - x * y + x * (y - 1), x)
    dirty = looked(made, (1.3, 0.7), call=lambda *_: np.array([1e-17, 1.3])).outputs[0]
    assert dirty.of_zeros == pytest.approx(1e-17 / 1.3) and dirty.worst is None
    tiny = looked(system(x * 10**-9, x), (1.3, 0.7), call=lambda *_: np.array([1.3e-9 + 1e-16, 1.3]))
    assert tiny.outputs[0].verdict == "small entry"
    assert tiny.outputs[0].worst.entry == "1" and tiny.outputs[0].beyond_largest < 1


def test_not_a_number_is_an_infinite_error():
    found = looked(system(x, y), (1.3, 0.7), call=lambda *_: np.array([math.nan, 0.7]))
    assert found.outputs[0].verdict == "code" and math.isinf(found.outputs[0].worst.ulps)
    assert found.summary()["outputs"][0]["worst"]["ulps"] is None


def test_random_states_of_blocks_are_real():
    """A root or logarithm of a negative number is no output: other states are drawn."""
    states = of_block(system(sp.sqrt(x - y), sp.log(y - 1)), 6, 0).all
    assert len(states) == 6
    assert all(at.arrays["q"][0] >= at.arrays["q"][1] >= 1 for at in states)
    with pytest.raises(ModelError, match="planted is real at 0 of 100 states"):
        of_block(system(sp.sqrt(-x)), 2, 0)


@pytest.mark.parametrize("name", ["rod", "loop_screws", "loop_inertia"])
def test_slopes_are_those_of_finite_differences_in_many_digits(name):
    made = derived(name)
    exact, rng = Exact(made), np.random.default_rng(3)
    values = {g.name: rng.uniform(0.5, 2.0, len(g.quantities)) for g in made.groups}
    for kernel in lower_system(made).kernels:
        tape = Tape(kernel)
        found = tape.conditions(tape.values(values))
        names = next(e.matrices for e in made.exports if e.kernel == kernel.name)
        base = [e for m in exact.matrices(names, values) for e in m]
        total = [mpmath.mpf(0)] * len(base)
        with mpmath.workdps(DIGITS):
            step = mpmath.mpf(10) ** -18
            for group, array in values.items():
                for i in range(len(array)):
                    moved = {**values, group: [mpmath.mpf(float(a)) for a in array]}
                    moved[group][i] *= 1 + step
                    after = [e for m in exact.matrices(names, moved) for e in m]
                    total = [t + abs(b - a) / step for t, a, b in zip(total, base, after, strict=True)]
        for entry, (value, slope) in enumerate(zip(base, total, strict=True)):
            assert found[entry] == pytest.approx(float(slope), rel=1e-9, abs=1e-12), (kernel.name, entry)
            assert abs(tape.values(values)[tape.out[entry]] - value) < 1e-37


def test_influence_is_the_slope_of_one_result():
    (kernel,) = lower_system(system(sp.sin(x) * y + x**2 / y)).kernels
    tape = Tape(kernel)
    values = tape.values({"q": [1.3, 0.7]})
    found = tape.influence(values, 0)
    assert found[tape.inputs["q", 0]] == pytest.approx(math.cos(1.3) * 0.7 + 2 * 1.3 / 0.7)
    assert found[tape.inputs["q", 1]] == pytest.approx(math.sin(1.3) - (1.3 / 0.7) ** 2)


@pytest.mark.parametrize("scene", ["four_bar", "planar_4r"])
def test_the_report_of_a_scene_is_the_same_for_a_seed(scene):
    first, again = (accuracy(scene, states=3, seed=5).summary() for _ in range(2))
    other = accuracy(scene, states=3, seed=6).summary()
    assert first == again
    assert first != other
    assert first["states"] == {"run": 3, "closed": 3, "open": 3}
    assert {o["verdict"] for o in first["outputs"]} <= {"", "problem", "small entry"}


def test_random_states_on_the_constraints_are_on_them():
    found = accuracy("four_bar", states=4)
    (rows,) = (o for o in found.outputs if o.output == "constraints")
    assert rows.worst.condition > 1e13  # nothing is left of the lengths
    solved = next(o for o in found.outputs if o.output == "accelerations")
    assert solved.of_largest < 1e-13 and found.condition[0] < 100
    assert accuracy("four_bar", states=2, run=False).states == {"run": 1, "closed": 2, "open": 2}


def test_elastic_scenes_show_all_their_kernels():
    kernels = {o.kernel.partition(".")[0] for o in accuracy("rotating_cantilever", states=1).outputs}
    assert {"accelerations", "elastic_motion", "elastic_joints", "element_beam8"} <= kernels


@pytest.mark.parametrize(
    ("scene", "precision"),
    [
        ("four_bar", "float32"),
        full("four_bar", "longdouble"),
        full("four_bar", "float128"),
        full("planar_4r", "float32"),
        full("planar_4r", "longdouble"),
        ("planar_4r", "float128"),
    ],
)
def test_other_precisions_by_their_own_epsilon(scene, precision):
    """Both orders of size: errors are of the type's rounding, and of no finer one."""
    try:
        found = accuracy(scene, states=2, precision=precision)
    except BuildError:
        if precision != "float128":
            raise
        pytest.skip("this compiler has no __float128")
    assert found.precision == precision and found.epsilon < 1e-6
    assert not [o for o in found.outputs if o.verdict == "code"]
    (energy,) = (o for o in found.outputs if o.output == "kinetic_energy")
    assert 0.01 * found.epsilon < energy.of_largest < 100 * found.epsilon


def test_a_block_by_its_name():
    found = accuracy("rod", states=3)
    assert isinstance(found, Accuracy) and found.condition is None
    assert max(o.beyond for o in found.outputs) < 10


def test_the_mass_of_a_rod_does_not_cancel():
    """Its centre at its end: from moments about the start, three digits were lost here."""
    made = derived("rod")
    values = {"q": np.ones(4), "u": np.ones(4), "p": np.array([1.1, 1.3, 1.2999, 1e-6])}
    kernel = next(k for k in lower_system(made).kernels if k.name == "mass_matrix")
    tape = Tape(kernel)
    found = tape.values(values)
    bound = sum(abs(float(v) * s) for v, s in zip(found, tape.influence(found, 0), strict=True))
    assert bound / abs(float(found[tape.out[0]])) < 3 * tape.conditions(found)[0] / float(found[tape.out[0]])


def test_assembly_leads_from_the_drawing():
    """The Jacobian of constraints does not depend on the way: what is drawn is a number."""

    for scene in ("thesis_four_bar", "rotating_cantilever", "peaucellier_limit", "crank_rocker"):
        made = derived(scene)
        way = made.group("u").quantities[0].symbol
        rows = [r for r in made["assembly_jacobian"].rows if not r.endswith(" angle")]
        expanded = made.expanded("assembly_jacobian")
        assert rows and not any(expanded[i, :].has(way) for i in range(len(rows))), scene


def test_command(tmp_path):
    file = tmp_path / "report.json"
    printed = json.loads(call("accuracy", "triple_pendulum", "--states", "2", "--json", "--out", file))
    assert printed == json.loads(file.read_text()) and printed["precision"] == "float64"
    assert "against 40 digits, at 2 states" in call("accuracy", "rod", "--states", "2", "--no-run")


@pytest.mark.parametrize(
    "arguments, error, words",
    [
        (["four_bat"], SceneError, "Did you mean 'four_bar'"),
        (["rod", "--set", "a=1 m"], ModelError, "building block"),
        (["four_bar", "--states", "0"], ModelError, "at least 1 state"),
        (["four_bar", "--seed", "-1"], ModelError, "seed from 0"),
        (["four_bar", "--precision", "float46"], ModelError, "Did you mean 'float64'"),
        (["four_bar", "--out", "a.txt"], ResultError, "ending in .json"),
    ],
)
def test_wrong_options(arguments, error, words):
    with pytest.raises(error, match=words):
        call("accuracy", *arguments)
