"""``model.rhs``: a right-hand side for the solvers of others, from Python and from C."""

from __future__ import annotations

import ctypes
import gc
import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy
from scipy.integrate import solve_ivp
from scipy.ndimage import generic_filter1d
from shared.linkages import G, at, ground, rod

import symgen
from symgen.errors import ModelError
from symgen.toolchain.compiler import find_compiler

#: What a solver in C does with a right-hand side: the classical Runge-Kutta method, in fixed steps.
SOLVER = """
#include <string.h>
typedef void (*rhs)(double t, double *y, double *dy, void *user_data);
void solve(rhs f, void *user_data, int n, double *y, double h, int steps) {
    double k[4][64], x[64];
    for (int s = 0; s < steps; s++) {
        for (int j = 0; j < 4; j++) {
            double part = j == 0 ? 0.0 : j == 3 ? h : h / 2;
            memcpy(x, y, n * sizeof(double));
            for (int i = 0; j && i < n; i++) x[i] += part * k[j - 1][i];
            f(s * h + part, x, k[j], user_data);
        }
        for (int i = 0; i < n; i++) y[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
    }
}
"""


@pytest.fixture(scope="module")
def solver(tmp_path_factory):
    """Compile a solver that takes a function pointer and user data."""
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("solver")
    (folder / "solver.c").write_text(SOLVER)
    command = [
        *compiler.command,
        "-O1",
        "-shared",
        "-fPIC",
        "-ffp-contract=off",
        "solver.c",
        "-o",
        "solver.so",
    ]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "solver.so")).solve


def in_c(solver, rhs, h, steps):
    """Integrate with the solver in C, which calls the compiled function without Python's lock."""
    y, handle = rhs.start.copy(), rhs.low_level
    address = ctypes.c_void_p(y.ctypes.data)
    solver(handle.function, handle.user_data, len(y), address, ctypes.c_double(h), steps)
    return y


def in_python(rhs, h, steps):
    y = rhs.start.copy()
    for s in range(steps):
        k = [rhs(s * h, y)]
        for part in (h / 2, h / 2, h):
            k.append(rhs(s * h + part, y + part * k[-1]))
        y = y + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    return y


@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA"])
@pytest.mark.parametrize("scene", ["peaucellier", "triple_pendulum"])
def test_scipy_integrates_it(scene, method):
    """The same motion as the program's own integrator, to what the tolerance leaves."""
    model = symgen.build(scene)
    f = model.rhs
    motion = solve_ivp(f, (0, 0.5), f.start, method=method, rtol=1e-9, atol=1e-11)
    assert motion.success
    own = model.simulate(0.5, rtol=1e-12)
    n, axes = model.description.coordinates, len(model.description.axes)
    for i, point in enumerate(model.description.free):
        place = motion.y[i * axes : (i + 1) * axes, -1]
        speed = motion.y[n + i * axes : n + (i + 1) * axes, -1]
        assert place == pytest.approx(own.final[point]["position"], abs=1e-7)
        assert speed == pytest.approx(own.final[point]["velocity"], abs=1e-6)


def test_it_is_rates_and_accelerations():
    """Off the start too, where a load that works without potential is counted in no further unknown."""
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0), "B": at(2, 0)},
        links={"OA": rod("O", "A"), "AB": rod("A", "B")},
        forces=[{"point": "B", "force": ["3 N", "2 N"]}],
        gravity={"acceleration": ["0 m/s^2", f"{-G} m/s^2"]},
    )
    model = symgen.build(scene)
    assert model.description.work_of_loads
    state = model.state({"A": [0.6, 0.8], "B": [1.6, 0.8]}, {"A": [-0.8, 0.6], "B": [-0.8, 1.6]})
    dy = model.rhs(0.0, np.concatenate([state.q, state.u]))
    assert dy.shape == (8,)
    assert np.array_equal(dy[:4], state.u)
    found = model.accelerations(state)
    assert dy[4:] == pytest.approx(np.concatenate([found["A"], found["B"]]), rel=1e-14)
    assert model.rhs(0.0, list(model.rhs.start)) is not model.rhs(0.0, model.rhs.start)


def test_a_result_stays_what_it_was():
    f = symgen.build("triple_pendulum").rhs
    first = f(0.0, f.start)
    kept = first.copy()
    f(0.0, f(0.1, f.start))
    assert np.array_equal(first, kept)


def test_parameters_are_those_of_the_model():
    """A pendulum at rest and level: its end falls with 3/2 of g, whatever other models there are."""
    scene = symgen.Scene(
        parameters={"g": {"value": "9.81 m/s^2", "tunable": True}},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": rod("O", "A")},
        gravity={"acceleration": ["0 m/s^2", "-g"]},
    )
    model = symgen.build(scene)
    light = model.with_parameters(g=1.62).rhs
    assert model.rhs(0.0, light.start)[3] == pytest.approx(-1.5 * 9.81)
    assert light(0.0, light.start)[3] == pytest.approx(-1.5 * 1.62)


def test_a_solver_in_c_integrates_it(solver):
    """By pointer and user data: the same bits as the same steps made from Python."""
    f = symgen.build("peaucellier").rhs
    assert isinstance(f.low_level, scipy.LowLevelCallable)
    assert f.low_level.signature == "void (double, double *, double *, void *)"
    assert np.array_equal(in_c(solver, f, 1e-3, 200), in_python(f, 1e-3, 200))


def test_what_the_pointer_needs_lives_as_long_as_it(solver):
    handle = symgen.build("peaucellier").rhs.low_level
    f = symgen.build("peaucellier").rhs
    y = f.start.copy()
    solver(handle.function, handle.user_data, 16, ctypes.c_void_p(y.ctypes.data), ctypes.c_double(1e-3), 9)
    assert np.array_equal(y, in_python(f, 1e-3, 9))


def test_each_thread_with_one_of_its_own(solver):
    """Without Python's lock, side by side: every model.rhs has scratch memory of its own."""
    model = symgen.build("peaucellier")
    expected = in_python(model.rhs, 1e-3, 200)
    with ThreadPoolExecutor(4) as pool:
        ended = list(pool.map(lambda f: in_c(solver, f, 1e-3, 200), [model.rhs for _ in range(8)]))
    assert all(np.array_equal(y, expected) for y in ended)


def test_python_threads_share_one():
    f = symgen.build("peaucellier").rhs
    expected = in_python(f, 1e-3, 50)
    with ThreadPoolExecutor(4) as pool:
        ended = list(pool.map(lambda _: in_python(f, 1e-3, 50), range(8)))
    assert all(np.array_equal(y, expected) for y in ended)


def test_scipy_reads_the_signature():
    """A consumer of SciPy parses it, and refuses it by name because it wants another one."""
    handle = symgen.build("peaucellier").rhs.low_level
    with pytest.raises(ValueError, match=r"void \(double, double \*, double \*, void \*\)"):
        generic_filter1d(np.zeros(4), handle, 3)


def test_project_and_energy():
    """A pendulum off its circle comes back by the least change; its energy is that of a rod."""
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(0.6, -0.8)},
        links={"OA": rod("O", "A", 3.0)},
        gravity={"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
    )
    f = symgen.build(scene).rhs
    along, across = np.array([0.6, -0.8]), np.array([0.8, 0.6])
    off = np.concatenate([1.001 * along, 2.0 * across + 0.01 * along])
    on = f.project(0.0, off)
    assert on == pytest.approx(np.concatenate([along, 2.0 * across]), abs=1e-14)
    assert off[0] == 1.001 * along[0]
    assert f.energy(0.0, on) == pytest.approx(3.0 * 1.0 / 3 * 2.0**2 / 2 - 3.0 * G * 0.8 / 2, rel=1e-14)
    with pytest.raises(ModelError, match="cannot be brought onto the constraints"):
        f.project(0.0, np.zeros(4))


@pytest.mark.parametrize(
    ("y", "got"),
    [
        (np.zeros(3), r"got shape \(3,\)"),
        (np.zeros((4, 4)), r"got shape \(4, 4\)"),
        ("no", "got 'no'"),
    ],
)
@pytest.mark.parametrize("word", ["__call__", "project", "energy"])
def test_a_state_of_another_shape(y, got, word):
    f = symgen.build("peaucellier").rhs
    with pytest.raises(ModelError, match=r"expected a state y = \(q, u\) of 16 (?:real )?numbers, " + got):
        getattr(f, word)(0.0, y)


def test_with_the_numpy_backend(solver):
    """Kernels in Python live as long as what calls them, whether or not the model does."""
    f = symgen.build("peaucellier", backend="numpy").rhs
    compiled = symgen.build("peaucellier").rhs
    gc.collect()
    assert f(0.0, f.start) == pytest.approx(compiled(0.0, compiled.start), rel=1e-12, abs=1e-14)
    assert in_c(solver, f, 1e-3, 3) == pytest.approx(in_python(compiled, 1e-3, 3), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("scene", ["cssp", "rssr"])
def test_equations_of_a_loop_keep_their_kernels(scene):
    """The same, of loops: the closure is looked at after the model is gone."""
    compiled, free = (symgen.build(scene, backend=backend) for backend in ("c", "numpy"))
    start = compiled.closed_start().q
    solved, rank = range(len(compiled.description.variables)), 6
    expected = compiled.kernels.equations(solved, rank).closed_screws(0.0, start)[1]
    equations = free.kernels.equations(solved, rank)
    del free
    gc.collect()
    assert equations.closed_screws(0.0, start)[1] == pytest.approx(expected, abs=1e-12)


def test_states_of_another_solver_are_recorded(tmp_path):
    """As a run with the same law in the scene, which turns the rod by revolutions; the input is passed."""
    scene = symgen.Scene(
        inputs={"M": "0 N*m"},
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": {"points": ["O", "A"], "mass": "3 kg"}},
        gravity={"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
        torques=[{"link": "OA", "torque": "M"}],
        analysis={"t_end": "2 s", "outputs": ["OA.angle", "O.reaction", "torques.0.torque", "energy"]},
    )
    model = symgen.build(scene)
    law = {"parameters": {"M0": "40 N*m", "c": "2 N*m*s"}, "torques.0.torque": "M0 - c*OA.rate"}
    own = symgen.build(scene, set=law).simulate(rtol=1e-11)

    def torque(y):
        return [40 - 2 * (y[0] * y[3] - y[1] * y[2]) / (y[0] ** 2 + y[1] ** 2)]

    f = model.rhs
    motion = solve_ivp(
        lambda t, y: f(t, y, torque(y)), (0, 2), f.start, rtol=1e-11, atol=1e-12, t_eval=own.time
    )
    run = model.record(motion.t, motion.y.T, [torque(y) for y in motion.y.T])
    assert own["OA.angle"].values[-1] > 2 * np.pi
    for name in own:
        assert run[name].values == pytest.approx(own[name].values, rel=1e-6, abs=1e-6), name
    assert 0 < run.drift.constraint < 1e-6 and np.isnan(run.drift.energy)
    assert run.final["A"]["position"] == motion.y[:2, -1].tolist()
    free = model.record(motion.t, motion.y.T)  # with the input of the model
    assert not free["torques.0.torque"].values.any() and np.any(free["O.reaction"] != run["O.reaction"])
    page = tmp_path / "moving.html"
    run.animate(page)
    assert page.stat().st_size > 10_000


def test_states_that_are_none_are_refused():
    model = symgen.build("triple_pendulum")
    with pytest.raises(ModelError, match=r"simulate has no argument 'inputs'.*model\.record makes a result"):
        model.simulate(inputs=[1.0])
    t, y = [0.0, 0.1], np.tile(model.rhs.start, (2, 1))
    for arguments, words in (
        ((t, y[:, 1:]), r"expected states of shape \(2, 12\)"),
        (([0.0, 0.1, 0.2], y.T), "expected states of shape"),
        ((t, [*zip(*y, strict=True)]), r"a row per time: motion.y.T"),
        ((t, y * np.nan), "expected finite numbers for states"),
        ((t[::-1], y), "expected increasing times"),
        ((t, y, np.zeros((2, 1))), r"expected inputs of shape \(2, 0\)"),
    ):
        with pytest.raises(ModelError, match=words):
            model.record(*arguments)
