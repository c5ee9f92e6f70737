"""The analyses of models: the same names and arguments everywhere, absent where not supported."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest

import symgen
from symgen.errors import CapabilityError, ModelError, SymgenError
from symgen.runtime.model.model import VERBS
from symgen.runtime.model.verbs import accepted

LINEAR = {"linearise", "mass_matrix", "jacobian", "sensitivity"}
RODS = {
    "simulate",
    "stepper",
    "record",
    "coordinates",
    "equilibrium",
    "modes",
    "accelerations",
    "batch",
} | LINEAR
DRIVEN = {"kinematics", "inverse_dynamics", "assemblies"}
AT_REST = {"equilibrium", "modes"}
ELASTIC = {"periodic", "quasi_static", "large_rotation", "speed_response", "matrices"}
EXACT = {"sensitivity"}
SUPPORTED = {
    "four_bar": RODS,
    "double_four_bar": RODS,  # as many constraints as coordinates, one of them redundant
    "crank_rocker": (RODS | DRIVEN) - AT_REST,
    "slider_crank": DRIVEN | {"batch", "coordinates", "sensitivity", "jacobian"},
    "cssp": {
        "simulate",
        "stepper",
        "coordinates",
        "assemblies",
        "batch",
        "linearise",
        "sensitivity",
        "mass_matrix",
        "jacobian",
    },
    "thesis_four_bar": RODS - {"accelerations", "record", "coordinates", "equilibrium"} - LINEAR
    | DRIVEN
    | ELASTIC
    | EXACT,
    "elastic_four_bar_motor": RODS - {"accelerations", "record", "coordinates"} - LINEAR
    | DRIVEN
    | ELASTIC
    | EXACT,
}
KINEMATIC = {"analysis.kind": "kinematics", "analysis.outputs": []}


#: Analyses of which many runs are carried out in a call.
IN_MANY = {"simulate", "kinematics", "inverse_dynamics", "equilibrium", "modes", "periodic", "quasi_static"}


def with_many(analyses):
    return analyses | {f"{name}_many" for name in analyses & IN_MANY}


@pytest.mark.parametrize("scene", SUPPORTED)
def test_models_support_the_analyses_of_their_kind(scene):
    model, expected = symgen.build(scene), with_many(SUPPORTED[scene])
    assert set(model.capabilities) == expected
    assert {name for name in VERBS if hasattr(model, name)} == expected
    assert set(dir(model)) & set(VERBS) == expected


def test_kinematic_scenes_and_user_defined_systems_support_few(tmp_path):
    model = symgen.build("crank_rocker", set=KINEMATIC)
    assert set(model.capabilities) == with_many(DRIVEN - {"inverse_dynamics"} | {"batch", "coordinates"})
    with pytest.raises(CapabilityError, match=r"kinematics only(.|\n)*analysis\.kind=dynamics"):
        model.simulate()
    file = tmp_path / "square.py"
    file.write_text(
        "import sympy as sp\n"
        "from symgen.symbolic.quantity import quantity\n"
        "from symgen.symbolic.system import Export, Group, NamedMatrix, System\n"
        "def system():\n"
        "    x = quantity('x', 'm', 'a length')\n"
        "    area = NamedMatrix('area', sp.ImmutableMatrix([[x.symbol**2]]), 'm^2', 'its square')\n"
        "    return System(name='square', title='Square', groups=(Group('q', 'length', (x,)),),\n"
        "                  matrices=(area,), exports=(Export('squared', 'square', ('area',)),))\n"
    )
    own = symgen.build(file)
    assert isinstance(own, symgen.Model) and own.capabilities == ("evaluate",)
    with pytest.raises(CapabilityError, match="user-defined system"):
        own.batch("squared", 0.0, [[2.0]])
    assert isinstance(own, symgen.SystemModel) and own.evaluate("squared", q=[3.0])["area"] == 9.0


@pytest.mark.parametrize(
    ("angle", "missing", "reason"),
    [
        ("0.4", {"modes"}, "constraints and drives hold every freedom"),
        ("0.4 + speed*t", AT_REST, "the drive of link crank moves at all times"),
        ("0.4 + (t/T)**3", {"modes"}, "constraints and drives hold every freedom"),
    ],
)
def test_a_driven_linkage_has_equilibria_where_its_drives_rest(angle, missing, reason):
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["cos(0.4)*m", "sin(0.4)*m"]}}
    scene = symgen.Scene(
        parameters={"speed": "2 rad/s", "T": "0.5 s", "m": "1 m"},
        points=points,
        links={"crank": {"points": ["O", "A"], "mass": "2 kg"}},
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        drivers=[{"link": "crank", "angle": angle}],
    )
    model = symgen.build(scene, backend="numpy")
    assert AT_REST - set(model.capabilities) == missing
    with pytest.raises(CapabilityError, match=reason):
        model.modes  # noqa: B018
    if "equilibrium" not in missing:
        assert model.equilibrium().reactions["O"].sum() == pytest.approx(2 * 9.81)


def test_missing_analyses_give_the_reason_when_accessed():
    loop = symgen.build("slider_crank")
    with pytest.raises(
        CapabilityError, match="slider_crank does not support modes: it is a link-joint table"
    ):
        loop.modes  # noqa: B018
    with pytest.raises(CapabilityError, match="no free variable"):
        loop.simulate  # noqa: B018
    with pytest.raises(CapabilityError, match="free variables"):
        symgen.build("cssp").kinematics  # noqa: B018
    with pytest.raises(CapabilityError, match="needs 1 more drive"):
        symgen.build("four_bar").inverse_dynamics  # noqa: B018
    with pytest.raises(CapabilityError, match="evaluate: it calls kernels of user-defined systems"):
        loop.evaluate  # noqa: B018
    with pytest.raises(CapabilityError, match="slider_crank does not support rhs"):
        loop.rhs  # noqa: B018
    assert not hasattr(loop, "rhs") and hasattr(symgen.build("four_bar"), "rhs")
    with pytest.raises(CapabilityError, match="no singular poses: kinematics and inverse_dynamics"):
        symgen.build("cssp").simulate(0.01).dead_centres  # noqa: B018
    assert issubclass(CapabilityError, SymgenError) and issubclass(CapabilityError, AttributeError)


@pytest.mark.parametrize(
    ("scene", "call", "named"),
    [
        ("crank_rocker", lambda m: m.simulate(0.1, revolutions=2.0), "revolutions"),
        ("slider_crank", lambda m: m.kinematics(of=["A"]), "of"),
        ("slider_crank", lambda m: m.inverse_dynamics(elements=2, sections=[0.5]), "elements, sections"),
        ("cssp", lambda m: m.simulate(0.1, stabilisation_rate=3.0), "stabilisation_rate"),
        ("thesis_four_bar", lambda m: m.simulate(stabilisation="raw"), "stabilisation"),
        ("crank_rocker", lambda m: m.inverse_dynamics(through=True), "through"),
    ],
)
def test_arguments_of_other_kinds_of_models_are_refused_by_name(scene, call, named):
    with pytest.raises(ModelError, match=f"of {scene} does not accept {named}\n  It accepts"):
        call(symgen.build(scene))


def test_linkages_are_evaluated_at_values_of_their_drive_and_at_times():
    model = symgen.build("crank_rocker")
    angles = np.radians([60.0, 0.0, 300.0, 30.0])
    radius = 0.1
    expected = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found = model.kinematics(at=angles, of=["A"])
    np.testing.assert_allclose(found.variable("A.position").values, expected, atol=1e-13)
    again = model.kinematics(at=found.time, over="time", of=["A"])
    np.testing.assert_allclose(again.variable("A.position").values, expected, atol=1e-13)
    spaced = model.inverse_dynamics(0.2, 1.0, over="input", samples=5)
    assert spaced.variable("crank.angle").values == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0], abs=1e-12)
    at_times = model.inverse_dynamics(at=spaced.time[[3, 1]], over="time")
    torque = spaced.variable("crank.torque").values
    assert at_times.variable("crank.torque").values == pytest.approx(torque[[3, 1]], rel=1e-13)
    (pose, other), t = model.assemblies(angles[0]), found.time[0]
    for state in (pose, other):
        assert state.t == pytest.approx(t, abs=1e-12)
        assert state.positions["A"] == pytest.approx(expected[0], abs=1e-12)
    for wrong in (
        {"at": [0.1], "through": True},
        {"over": "angle"},
        {"over": "input"},
        {"at": [], "over": "time"},
    ):
        with pytest.raises(ModelError):
            model.kinematics(**wrong)


def test_the_kinematics_of_a_loop_is_the_motion_without_its_forces():
    model = symgen.build("slider_crank")
    at = [0.3, 1.0, 2.0]
    motion, whole = model.kinematics(at=at), model.inverse_dynamics(at=at)
    names = set(motion)
    assert {"theta2", "S4", "S4.acceleration"} <= names < set(whole)
    assert not any(name.endswith((".force", ".moment", ".drive")) for name in names)
    for name in names:
        np.testing.assert_array_equal(motion.variable(name).values, whole.variable(name).values)
    assert motion.drift == whole.drift
    times = model.kinematics(at=motion.time, over="time")
    assert motion.coordinate.name == "theta1" and times.coordinate.name == "time"
    np.testing.assert_allclose(times.variable("theta1").values, at, rtol=1e-13)
    assert model.assemblies(at=at[0]) == model.assemblies(at=float(motion.time[0]), over="time")


def test_elastic_links_run_to_a_time_or_over_revolutions():
    model = symgen.build("thesis_four_bar")
    period = 2 * math.pi / model.crank_speed
    by_time = model.simulate(period / 4, steps=256, samples=5)
    by_revolutions = model.simulate(revolutions=0.25, steps=256, samples=5)
    assert by_time.time[-1] == pytest.approx(period / 4, rel=1e-15)
    assert by_time.peaks == by_revolutions.peaks
    with pytest.raises(ModelError, match="t_end or revolutions, not both"):
        model.simulate(0.1, revolutions=1.0)
    with pytest.raises(ModelError, match=r"It is model\.periodic\(\)"):
        model.simulate(method="periodic")
    rigid = model.kinematics(at=[0.5], of=["A"]).variable("A.position").values
    np.testing.assert_array_equal(
        rigid, model.rigid.kinematics(at=[0.5], of=["A"]).variable("A.position").values
    )


@pytest.mark.parametrize(
    "result",
    [
        lambda _: symgen.build("crank_rocker").kinematics(samples=4),
        lambda _: symgen.build("crank_rocker").inverse_dynamics(samples=4),
        lambda _: symgen.build("slider_crank").kinematics(at=[0.5]),
        lambda _: symgen.build("four_bar").simulate(0.1, samples=2),
        lambda speed_response: speed_response,
    ],
    ids=["kinematics", "inverse_dynamics", "loop", "simulate", "speed_response"],
)
def test_every_result_has_facts_and_a_page_in_a_notebook(result, speed_response):
    found = result(speed_response)
    assert dict(found.facts)
    assert found._repr_html_().startswith("<")


def test_a_run_is_repeated_from_the_state_that_it_was_given():
    """Also when the caller changes that state afterwards."""
    model = symgen.build("triple_pendulum")
    state = model.initial_state()
    run = model.simulate(t_end=0.1, samples=3, state=state)
    kept = run.variables[0].values[1].copy()
    state.u[:] = 3.0
    assert np.array_equal(run.at([0.05]).variables[0].values[0], kept)


@pytest.mark.parametrize("scene", [*SUPPORTED, "spatial_slider_crank"])
def test_models_accept_no_argument_that_is_not_declared(scene):
    """A method that renames an argument of the analysis it carries out would never be given it."""
    model = symgen.build(scene)
    for name in model.capabilities:
        declared = set(inspect.signature(getattr(type(model), name)).parameters)
        assert accepted(model, name) <= declared, name
