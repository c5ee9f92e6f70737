"""Every kernel of every shipped model, on every backend, against 40-digit evaluation at random states."""

from __future__ import annotations

import importlib

import mpmath
import numpy as np
import pytest
from shared.full import full_unless
from shared.oracle import Oracle, relative_error
from shared.rich_scenes import joined_bodies, rich_scene
from shared.shipped import LINKAGES, LOOPS, REPEATED, derived, lowered, rigid
from shared.states import random_values

import symgen
from symgen.codegen.emit import emit, equations_hash
from symgen.codegen.target import Target
from symgen.models import SHIPPED_BLOCKS
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.loop.kernels import LoopKernels

#: Scenes that use every word of the vocabulary in the plane, and in space.
WORDS = {"plane": symgen.Scene(**rich_scene(everything=True)), "space": symgen.Scene(**joined_bodies())}
STATES = 3
#: Relative to the largest entry of a kernel's result. The assembly residual cancels to nothing by design.
TOLERANCE = 1e-13
#: Off the constraints, a random state has the crank almost across its prescribed direction: their scalar product
#: in the power of the drive cancels to a hundredth of its terms.
CANCELS = {("spatial_slider_crank", "power"): 1e-12}
SOLUTION_TOLERANCE = 2e-11
#: Off the constraints, a redundant one is nearly dependent on the others.
REDUNDANT_TOLERANCE = 1e-9
#: Unknowns beyond which one state must do: their solution off the constraints takes long.
MANY = 60


@pytest.mark.parametrize(
    ("scene", "backend"),
    full_unless(
        lambda scene, backend: (
            scene in ("four_bar", "peaucellier", *WORDS) or (backend == "c" and scene not in REPEATED)
        ),
        [(scene, backend) for scene in (*LINKAGES, *WORDS) for backend in ("c", "numpy")],
    ),
)
def test_scene_kernels(scene, backend):
    model = rigid(symgen.build(WORDS.get(scene, scene), backend=backend))
    system = derived(WORDS.get(scene, scene))
    oracle = Oracle(system)
    exports = {e.kernel: e.matrices for e in system.exports}
    rng = np.random.default_rng(0x5EED)
    checked = set()
    tolerance = REDUNDANT_TOLERANCE if model.redundant else SOLUTION_TOLERANCE
    for _ in range(STATES if len(system.group("work").quantities) < MANY else 1):
        values = random_values(system, model, rng)
        evaluate = Evaluator(model.description, model.evaluator.library, values["p"])
        t, q, u, work = values["t"][0], values["q"], values["u"], np.append(values["work"], 0.0)
        for kernel, matrices in exports.items():
            found = evaluate.blocks(kernel, t, q, u, work.copy())
            for name, exact in zip(matrices, oracle.matrices(matrices, values), strict=True):
                bound = CANCELS.get((scene, name), TOLERANCE)
                assert relative_error(found[name].ravel(), exact) < bound, (kernel, name)
            checked.add(kernel)
        solution = evaluate("accelerations", t, q, u)
        assert relative_error(solution, oracle.solve(values)) < tolerance
        memory = np.zeros(evaluate.work_size + 1)
        evaluate("factor", t, q, u, memory)
        rhs = rng.standard_normal(len(solution))
        solved = np.append(rhs, 0.0)
        _solve_in_place(evaluate, t, q, u, memory, solved)
        assert relative_error(solved[:-1], oracle.solve(values, mpmath.matrix(rhs))) < tolerance
        checked |= {"accelerations", "factor", "solve"}
    # The output of the set-up kernel enters all of these numbers.
    assert checked == {k.name for k in model.description.kernels} - {"setup"}


def _solve_in_place(evaluate, t, q, u, memory, solved):
    from symgen.runtime import _core

    address, sizes = evaluate.library.addresses["solve"], evaluate.description.sizes_of("solve")
    given = np.array([t]), np.append(q, 0), np.append(u, 0), evaluate.parameters
    _core.call(address, sizes, *given, memory, solved)


@pytest.mark.parametrize(
    ("scene", "backend"),
    full_unless(
        lambda scene, backend: backend == "c" or scene in ("slider_crank", "rssr"),
        [(scene, backend) for scene in LOOPS for backend in ("c", "numpy")],
    ),
)
def test_kernels_of_loops(scene, backend):
    """Anywhere, closed or not: no kernel takes the loop for closed."""
    model, system = symgen.build(scene, backend=backend), derived(scene)
    oracle, rng = Oracle(system), np.random.default_rng(0x1009)
    values = {g.name: rng.uniform(-1.5, 1.5, len(g.quantities)) for g in system.groups}
    tuned = np.array(model.parameter_values)
    values["p"] = np.where(tuned == 0, 1, tuned) * rng.uniform(0.7, 1.4, len(tuned))
    kernels = LoopKernels(model.description, model.kernels.library, values["p"])
    for export in system.exports:
        found = kernels(export.kernel, values["t"][0], values["q"], values["u"], values["work"])
        truth = oracle.matrices(export.matrices, values)
        for name, exact in zip(export.matrices, truth, strict=True):
            assert relative_error(found[name].ravel(), exact) < TOLERANCE, (export.kernel, name)
    assert {e.kernel for e in system.exports} == {k.name for k in model.description.kernels} - {"setup"}


def block_values(system, rng):
    values = {g.name: rng.uniform(0.5, 2.0, len(g.quantities)) for g in system.groups}
    return {name: values.get(name, np.zeros(0)) for name in ("t", "q", "u", "p", "work")} | values


@pytest.mark.parametrize("name", SHIPPED_BLOCKS)
def test_shipped_blocks(name):
    """The extension modules compiled at install, and the NumPy source of the same program."""
    system = derived(name)
    oracle = Oracle(system)
    module = importlib.import_module(f"symgen.generated.{name}")
    program = lowered(name)
    equations = equations_hash(program, Target())
    assert equations == module.EQUATIONS
    (source,) = emit(program, Target("numpy"), equations)
    namespace = {}
    exec(source.text, namespace)
    rng = np.random.default_rng(7)
    for _ in range(STATES):
        values = block_values(system, rng)
        for export in system.exports:
            exact = [x for matrix in export.matrices for x in oracle.matrix(matrix, values)]
            arrays = {k: values[k].copy() for k in ("q", "u", "p", "work")}
            found = getattr(module, export.kernel)(**arrays)
            assert relative_error(found, exact) < TOLERANCE
            slow = np.zeros(len(found))
            namespace[export.kernel](None, *(values[k].copy() for k in ("q", "u", "p", "work")), slow)
            assert relative_error(slow, exact) < TOLERANCE


def test_shipped_module_checks_its_arguments():
    module = importlib.import_module("symgen.generated.element_beam8")
    with pytest.raises(ValueError, match="q has 3 entries, expected 20"):
        module.shape(q=np.zeros(3), u=np.ones(1))
    with pytest.raises(TypeError, match="q is missing"):
        module.shape(u=np.ones(1))
    with pytest.raises(TypeError, match="expected a one-dimensional array of float64"):
        module.mass(q=np.ones(20, dtype=int))
    with pytest.raises(ValueError, match="with gaps"):
        module.mass(q=np.ones(40)[::2])
    assert "8 x 8" in module.mass.__doc__ and module.mass.__name__ == "mass"


def test_backends_agree_to_the_bit_where_no_function_is_called():
    compiled, slow = (symgen.build("peaucellier", backend=b) for b in ("c", "numpy"))
    state = compiled.initial_state()
    a, b = (m.accelerations(state) for m in (compiled, slow))
    assert a.as_dict() == b.as_dict()
