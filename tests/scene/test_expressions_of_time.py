"""Parameters that are expressions of the time: one law for a drive, a load and an output."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

import symgen
from symgen.errors import SceneError
from symgen.scene.loading import check_scene, override, text_of
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import in_letters
from symgen.scene.rods.linkage import TIME

TABLES = {
    "parameters": {
        "law": "rise*(profile.poly345(phase) + wave(t)/2)",
        "phase": "t/T",
        "rise": {"value": "0.5 rad", "tunable": True},
        "T": "0.25 s",
        "k": "3 N*m",
    },
    "tables": {
        "wave": {"x": ["0 s", "1 s", "2 s"], "y": [0, 1, 0], "kind": "cubic", "period": "2 s"},
    },
    "points": {"O": {"at": [0, 0], "ground": True}, "P": {"at": ["2 m", 0]}},
    "links": {"arm": {"points": ["O", "P"], "mass": "1 kg"}},
    "drivers": [{"link": "arm", "angle": "law"}],
    "torques": [{"link": "arm", "torque": "k*(law + 1)"}],
    "outputs": [{"name": "demand", "value": "law", "unit": "deg"}],
}


def turned(t):
    """The law, with the parabola through the symmetric points of the periodic cubic table: not a parabola.

    A periodic cubic through 0, 1, 0 over 2 s has zero slope at its points: 3 s^2 - 2 s^3.
    """
    u, s = np.minimum(t / 0.25, 1.0), t
    return 0.5 * (10 * u**3 - 15 * u**4 + 6 * u**5 + (3 * s**2 - 2 * s**3) / 2)


def test_a_law_of_time_is_written_once_for_a_drive_a_load_and_an_output():
    model = symgen.build(symgen.Scene(name="lift", **TABLES))
    t = np.array([0.0, 0.1, 0.2, 0.4, 0.9])
    run = model.simulate(t_eval=t)
    angle = turned(t)
    assert run["P.position"].values == pytest.approx(
        2 * np.stack([np.cos(angle), np.sin(angle)], 1), abs=1e-9
    )
    assert run["demand"].values == pytest.approx(angle, abs=1e-14)
    u = t / 0.25
    rising = np.where(u < 1, (60 * u - 180 * u**2 + 120 * u**3) / 0.25**2, 0.0)
    acceleration = 0.5 * (rising + (6 - 12 * t) / 2)
    forces = model.inverse_dynamics(at=t[:2].tolist(), over="time")
    inertia = 1.0 * 2.0**2 / 3
    needed = inertia * acceleration - 3 * (angle + 1)
    assert forces["arm.torque"].values == pytest.approx(needed[:2], abs=1e-8)
    gradient = model.sensitivity(["demand"], at=0.2)
    assert float(np.squeeze(gradient["demand", "rise"])) == pytest.approx(turned(0.2) / 0.5, abs=1e-12)


def test_a_law_is_set_as_every_parameter_and_keeps_the_letters_of_constants():
    scene = symgen.Scene(name="lift", **TABLES)
    sine = {"law": "rise*sin(phase)"}
    model = symgen.build(scene, set=sine)
    run = model.simulate(t_eval=[0.3])
    assert float(run["demand"][-1]) == pytest.approx(0.5 * math.sin(1.2), abs=1e-14)
    written, _ = in_letters(resolve(check_scene(override(text_of(scene), sine))))
    assert {"rise", "T"} <= {s.name for s in written.drivers[0].angle.free_symbols}
    assert {"rise", "T", "k"} <= {s.name for s in written.loads[0].expressions[-1].free_symbols}
    with pytest.raises(SceneError, match="a plain number or an angle .*, got 'law', a time"):
        symgen.build(scene, set={"law": "t"})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"law": {"value": "rise*t/T", "tunable": True}}, r"\[parameters.law\] value: law, an expression of the time t, cannot be tunable"),
        ({"links.arm.length": "2*law"}, r"got '2\*law'"),
        ({"links.arm.mass": "k*law"}, r"\[links.arm\] mass: the expression 'k\*law' uses law, an expression of the time t, where a constant is expected"),
        ({"phase": "law"}, r"these parameters are given by each other: law by phase by law"),
        ({"law": "rise*wav(t)"}, r"\[parameters.law\] value: .* calls 'wav'(.|\n)*'wave'"),
        ({"tables.wave.y": [0, "phase", 0]}, r"\[tables.wave\] y.*: the expression 'phase' uses phase, an expression of the time t"),
        ({"law": "rise*max(t/T - 1, 0)"}, r"\[drivers.0\] angle: .* its value or rate jumps"),
    ],
)  # fmt: skip
def test_faults_of_a_law_are_named_where_they_are(changes, message):
    with pytest.raises(SceneError, match=message):
        symgen.build(symgen.Scene(name="lift", **TABLES), set=changes)


def test_a_law_moves_a_loop():
    """The motion of the crank as the shipped scene writes it, and a torque."""
    changes = {
        "parameters": {"law": "speed*t", "friction": "drag*sin(law)", "drag": "2 N*m"},
        "loop.inputs.theta1": "law",
        "loop.loads": [{"link": "rocker", "torque": [0, 0, "friction"]}],
    }
    loop = resolve(symgen.load_scene("rssr", set=changes))
    speed, t = next(p.quantity.symbol for p in loop.parameters if p.quantity.name == "speed"), TIME.symbol
    assert next(v.motion for v in loop.variables if v.name == "theta1") == speed * t
    assert loop.loads[0].torque[2] == 2 * sp.sin(speed * t)


def test_a_law_is_no_name_for_itself():
    tables = TABLES | {"parameters": TABLES["parameters"] | {"law": "rise*lew"}}
    with pytest.raises(SceneError, match=r"unknown name 'lew'\n  Known: .*") as caught:
        symgen.build(symgen.Scene(**tables))
    assert "law" not in str(caught.value).rpartition("Known")[2]


def test_rates_of_torques_have_a_unit_of_their_own():
    tables = TABLES | {"states": {"M": {"start": "1 N*m", "rate": "k*k"}}}
    with pytest.raises(
        SceneError, match=r'expected a power or a rate of torque such as "50 W" or "50 N\*m/s"'
    ):
        symgen.build(symgen.Scene(**tables))
