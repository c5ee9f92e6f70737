"""Every array that the compiled binding takes is as long as the C code reads: shorter ones are refused."""

from dataclasses import replace

import numpy as np
import pytest

import symgen
from symgen.runtime import _beams, _core
from symgen.runtime._constrained import Constrained, Elements, Rows, Ties
from symgen.runtime._kinematics import Kinematics
from symgen.runtime.beams.elements import kernels
from symgen.runtime.elastic.large.collocation import EnvelopePattern
from symgen.runtime.elastic.mesh import MeshedMotion
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.rods.following.groups import groups_of


@pytest.fixture(scope="module")
def model():
    return symgen.build("peaucellier")


@pytest.fixture(scope="module")
def equations(model):
    return model.evaluator.equations()


def arrays(evaluator, kernel):
    sizes = evaluator.description.sizes_of(kernel)
    return sizes, [np.zeros(size) for size in sizes]


@pytest.mark.parametrize("short", range(6))
def test_a_kernel_refuses_any_short_argument(model, short):
    sizes, given = arrays(model.evaluator, "accelerations")
    address = model.evaluator.library.addresses["accelerations"]
    if not sizes[short]:
        pytest.skip("the kernel does not read this argument")
    given = [np.append(a, 0.0) for a in given]
    given[short] = np.zeros(sizes[short] - 1)
    with pytest.raises(ValueError, match=f"expected at least {sizes[short]} numbers in"):
        _core.call(address, sizes, *given)


def test_rows_of_kernels_are_all_there(model):
    evaluator, n = model.evaluator, model.description.coordinates
    sizes = evaluator.description.sizes_of("energy")
    address = evaluator.library.addresses["energy"]
    y, p = np.zeros((3, 2 * n)), evaluator.parameters
    work, out = np.zeros((3, sizes[4] + 1)), np.zeros((3, sizes[5]))
    _core.call_many(address, sizes, np.zeros(3), y, n, p, work, out)
    for t, some_work, some_out in (
        (np.zeros(2), work, out),
        (np.zeros(3), work[:2], out),
        (np.zeros(3), work, out[:2]),
        (np.zeros(3), work, out[:, :-1].copy()),
    ):
        with pytest.raises(ValueError, match="expected at least"):
            _core.call_many(address, sizes, t, y, n, p, some_work, some_out)
    with pytest.raises(ValueError, match="expected at least"):
        _core.call_many(address, sizes, np.zeros(3), y[:, :-1].copy(), n, p, work, out)


def test_equations_refuse_short_states_and_parameters(equations):
    y = np.zeros(2 * equations.n + equations.extra)
    with pytest.raises(ValueError, match="numbers in y"):
        equations.check(0.0, y[: equations.n])
    with pytest.raises(ValueError, match="numbers in y"):
        equations.derivative(0.0, y[:-1])
    with pytest.raises(ValueError, match="times"):
        equations.solutions(np.zeros(1), np.zeros((2, len(y))))
    with pytest.raises(ValueError, match="numbers in a row of y"):
        equations.solutions(np.zeros(2), np.zeros((2, equations.n)))


def test_a_run_needs_a_whole_state_and_its_events(equations):
    method, times = INTEGRATORS["dop853"], np.zeros(1)
    with pytest.raises(ValueError, match="expected a state of"):
        _core.Run(equations, method, 0.0, np.zeros(equations.dim - 1), 1.0, 1e-6, 1e-6, 0.0, times)
    with pytest.raises(ValueError, match="expected directions and ends of 0 events"):
        _core.Run(
            equations, method, 0.0, np.zeros(equations.dim), 1.0, 1e-6, 1e-6, 0.0, times,
            directions=(1,), terminal=(1,),
        )  # fmt: skip


class Scheme:
    """A method with counts of one's own, and so many numbers in its first array."""

    def __init__(self, kind, counts, numbers):
        names = {
            "explicit": "stages all_stages degree estimates same_as_last a b c error dense edge",
            "rattle": "parts side",
            "radau": "t t_inverse",
            "alpha": "alpha_m alpha_f beta gamma",
        }[kind].split()
        self.kind, first = kind, names[len(counts)]
        self.coefficients = (
            dict.fromkeys(names, ()) | dict(zip(names, counts, strict=False)) | {first: np.ones(numbers)}
        )
        self.adaptive, self.error_order = True, 4


@pytest.mark.parametrize(
    ("kind", "counts", "numbers"),
    [
        ("explicit", (1, 2, 1, 3, 0), 100),  # rows of error weights, of which there is room for two
        ("explicit", (4, 3, 1, 1, 0), 100),  # more stages of the solution than in all
        ("explicit", (33, 34, 1, 1, 0), 3000),
        ("explicit", (4, 5, 3, 1, 1), 20),
        ("rattle", (4,), 10),
        ("rattle", (7,), 1),
        ("radau", (), 16),
        ("alpha", (), 2),
    ],
)
def test_a_method_has_as_many_numbers_as_its_counts_say(equations, kind, counts, numbers):
    method = Scheme(kind, counts, numbers)
    with pytest.raises(ValueError, match=r"cannot have the counts|expected at least"):
        _core.Run(equations, method, 0.0, np.zeros(equations.dim), 1.0, 1e-6, 1e-6, 0.0, np.zeros(1))


def test_following_a_loop_needs_rows_and_columns():
    model = symgen.build("slider_crank")
    d = model.description
    solver = model.kernels.equations(d.having("dependent"), d.rank)
    n = d.coordinates
    out = d.kernel("outputs").out_size + 1
    q = np.array(d.start)
    states, rows, diagnosis = np.zeros((2, 3 * n + 6)), np.zeros((2, out)), np.zeros((2, 5))
    for bad in (
        (q[:-1], states, rows, diagnosis),
        (q, states[:1], rows, diagnosis),
        (q, states[:, :-1].copy(), rows, diagnosis),
        (q, states, rows[:1], diagnosis),
        (q, states, rows[:, :1].copy(), diagnosis),
        (q, states, rows, diagnosis[:, :4].copy()),
    ):
        with pytest.raises(ValueError, match="expected at least"):
            solver.follow(0.0, bad[0].copy(), np.zeros(2), 0.1, *bad[1:])
    with pytest.raises(ValueError, match="variables"):
        solver.close(0.0, q[:-1].copy())


@pytest.mark.parametrize(
    ("name", "value"),
    [*((name, 10**6) for name in ("slots", "places", "rows", "link_of", "joint_places", "loads_at", "constants_at")),
     *((name, -1) for name in ("mass_slots", "joint_at", "places_at", "slots_at"))],
)  # fmt: skip
def test_a_layout_may_not_point_outside_its_arrays(name, value):
    motion = MeshedMotion(symgen.build("elastic_slider_crank").rigid)
    values = np.array(getattr(motion.layout, name))
    values[0] = value
    with pytest.raises(ValueError, match=f"expected {name} from"):
        _beams.BeamEquations(motion.moved(), replace(motion.layout, **{name: values}), False)


@pytest.mark.parametrize(
    "wrong",
    [{"starts": [0, 1, 9]}, {"starts": [1, 1, 2]}, {"starts": [0, 2, 1, 2]}, {"coupling_starts": [0, 0]}],
)
def test_groups_may_not_start_outside_their_arrays(wrong):
    constraints = symgen.build("crank_rocker").constraints()
    groups = groups_of(constraints.slopes, range(constraints.n), constraints.n)
    Kinematics(constraints.kinematics, groups, 1.0, None)
    with pytest.raises(ValueError, match="expected .* starts|starts that rise|expected the groups"):
        Kinematics(constraints.kinematics, replace(groups, **wrong), 1.0, None)


def test_elements_are_within_their_states():
    """Rows without properties, states that are too short, and parts with more unknowns than their system."""
    addresses, places = kernels("corotational_beam").ADDRESSES, np.arange(6)[None]
    with pytest.raises(ValueError, match="at least 3"):
        Elements(addresses, np.repeat(places, 3, axis=0), np.ones((2, 9)), False)
    elements, q = Elements(addresses, places, np.ones((1, 9)), False), np.zeros((2, 6))
    for states in ((q[:, :5], q, q), (q, q[:1], q), (q, q, q[:, 1:])):
        with pytest.raises(ValueError, match="expected at least"):
            elements.values("residual", 6, *states)
    tie = Ties([0], [2], [1.0])
    pattern = EnvelopePattern(elements.pairs, tie.bound, 6, 1)
    system = Constrained(6, 1, 0, pattern, [elements, tie])
    t, multipliers, known = np.zeros(2), np.zeros((2, 1)), np.zeros((2, 0))
    for states in ((q[:, :5], q, q, multipliers), (q[:1], q, q, multipliers), (q, q, q, multipliers[:, :0])):
        with pytest.raises(ValueError, match="expected 2 rows of"):
            system.forces(t, *states, known, known)
    row, places, none = kernels("direction").ADDRESSES["row"], np.zeros((1, 21), np.intp), np.zeros((1, 0))
    given = places, 0, np.ones((1, 8)), none, none
    with pytest.raises(ValueError, match="expected at least 2 second slopes, got 1"):
        Rows(row, places, *given, np.arange(2), np.ones(1))
    beyond = Rows(row, places + 6, *given, np.arange(0), None)
    for wrong in (Ties([1], [2], [1.0]), Ties([0], [6], [1.0]), beyond):
        with pytest.raises(ValueError, match="expected .* to below"):
            Constrained(6, 1, 0, pattern, [elements, wrong])
