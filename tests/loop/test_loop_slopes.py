"""Derivatives of overconstrained loops, and at several times; tests/runtime has those of all shipped scenes."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest
from shared.exact_slopes import tunable_loop as tunable
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError
from symgen.scene.loading import shipped_scene

SINE = {"parameters.b": {"value": "size*sin(short)", "tunable": True}}


def bennett(motion=None, at="0 deg", rate="2 rad/s", off=False, **parameters):
    """Bennett's linkage with all its sizes tunable, driven by a motion, or free under gravity."""
    written = tomllib.loads(shipped_scene("bennett")) | {"analysis": {"t_end": "1 s"}}
    for name in ("size", "short", "long"):
        written["parameters"][name] = {"value": written["parameters"][name], "tunable": True}
    written["parameters"] |= parameters
    loop = written["loop"]
    if off:  # one length by 20 um
        loop["rows"][2]["a"] = "b + size/1e4"
        written["analysis"]["assembly_tolerance"] = "190 um"
    if motion:
        loop["inputs"] = {"theta1": motion}
    else:
        del loop["range"]
        loop |= {"inputs": {}, "free": {"theta1": {"at": at, "rate": rate}}}
        loop["start"] = {"theta2": "180 deg", "theta3": "0 deg", "theta4": "-180 deg"}
        written["gravity"] = {"acceleration": [0, "-9.81 m/s^2", 0]}
    return build(symgen.Scene(**written))


def test_one_link_of_an_overconstrained_loop_alone_has_no_derivatives():
    """Bennett's linkage closes with lengths as the sines of twists: one of them alone opens it."""
    length = f"{0.2 * math.sin(math.radians(40.0))!r} m"
    model = tunable("bennett", **{"parameters.b": {"value": length, "tunable": True}})
    assert model.sensitivity(["theta2"], ["speed", "line"])["theta2", "line"] == 0.0
    for name in ("b", "short"):
        with pytest.raises(ModelError, match=f"a change of {name} alone opens the redundant closure"):
            model.sensitivity(["theta2"], [name])


@pytest.mark.parametrize("time", [0.0, 1e-6, 0.5])
def test_a_length_that_opens_the_neighbours_of_a_flat_pose_has_no_derivatives(time):
    """In line, at 0 and 180 deg, the loop closes to first order with another length, but cannot turn."""
    model = build("bennett", set=SINE)
    with pytest.raises(ModelError, match="a change of b alone opens the redundant closure equations"):
        model.sensitivity(["theta2.rate"], ["b"], at=time)


def test_a_length_that_opens_a_loop_has_no_derivatives_from_a_flat_pose_on():
    """Whether it moves there, is at rest, or begins to move smoothly."""
    length = {"b": SINE["parameters.b"]}
    moving, resting = bennett(**length), bennett(rate="0 rad/s", **length)
    smooth = bennett("speed*t*(speed*t)**3", **length)
    for model, more in (
        (moving, {"t_eval": [0.1, 0.3]}),
        (resting, {}),
        (resting, {"t_eval": [0.1]}),
        (smooth, {}),
    ):
        for by in ("b", "short"):
            with pytest.raises(ModelError, match=f"a change of {by} alone opens the redundant closure"):
                model.sensitivity(["theta2"], [by], **more)


def test_a_flat_pose_has_derivatives_by_sizes_that_keep_the_loop_closed():
    """tan(theta1/2) tan(theta2/2) = K = sin((long + short)/2)/sin((long - short)/2): in line theta2' = -w/K, -w K."""
    model = bennett("speed*t")
    w, short, long = (model.parameters[name] for name in ("speed", "short", "long"))
    k = math.sin((long + short) / 2) / math.sin((long - short) / 2)
    cotangents = [1 / math.tan((long + sign * short) / 2) for sign in (1, -1)]
    by_angles = [k * (cotangents[0] + cotangents[1]) / 2, k * (cotangents[0] - cotangents[1]) / 2]
    names = ["speed", "short", "long", "size"]
    for time, rate, by_k in ((0.0, -w / k, w / k**2), (0.5, -w * k, -w)):
        found = model.sensitivity(["theta2.rate", "theta2"], names, at=time)
        expected = [rate / w, *(by_k * x for x in by_angles), 0.0]
        assert found.values[0] == pytest.approx(rate, rel=1e-12)
        assert found.derivatives[0] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        by_speed = time * rate / w
        assert found.derivatives[1] == pytest.approx([by_speed, 0.0, 0.0, 0.0], rel=1e-10, abs=1e-10)


def test_a_run_from_a_flat_pose_has_the_slopes_of_assembled_neighbours():
    model, step, options = bennett(), 1e-4, {"rtol": 1e-11, "atol": 1e-13}
    outputs, end = ["theta1", "theta2", "theta2.rate"], 0.2
    found = model.sensitivity(outputs, ["short", "size"], t_end=end, **options).derivatives[-1]
    for column, name in zip(found.T, ("short", "size"), strict=True):

        def ended(by, name=name):
            other = model.with_parameters(**{name: model.parameters[name] * (1 + by)})
            run = other.simulate(end, samples=2, **options)
            return np.array([run.variable(x).values[-1] for x in outputs])

        coarse, fine = ((ended(h) - ended(-h)) / (2 * h * model.parameters[name]) for h in (2 * step, step))
        assert column == pytest.approx((4 * fine - coarse) / 3, rel=1e-6)


def test_a_loop_that_closes_within_its_tolerance_only_says_so():
    """Of an overconstrained loop with one length off by 20 um, masses alone have exact derivatives."""
    model = bennett("speed*t", off=True, line={"value": "0.8 kg/m", "tunable": True})
    found = model.sensitivity(["energy"], ["line"], at=0.1)
    assert found["energy", "line"] == pytest.approx(found.values[0] / 0.8, rel=1e-9)
    for output, name in (("theta2", "speed"), ("theta1.drive", "line")):
        with pytest.raises(
            ModelError, match="redundant constraints only to 9.2e-05 of its size at t = 0.1 s"
        ):
            model.sensitivity([output], [name], at=0.1)
    model = bennett(at="10 deg", off=True)
    start = model.initial_state()
    runs = model.simulate(0.01), model.simulate(0.01, state=start)
    assert runs[0].variable("theta1").values[-1] == runs[1].variable("theta1").values[-1]
    for by in ("theta1", "size"):
        with pytest.raises(
            ModelError, match="redundant constraints only to .* a change of its free variables"
        ):
            model.sensitivity(["theta2"], [by], t_end=0.01)
    with pytest.raises(ModelError, match="redundant constraints only to .* a change of its free variables"):
        model.linearise(start)


def test_a_dead_centre_is_named():
    """Coupler and rocker in line: 0.45 m from the crank at acos(-1/8)."""
    sizes = {"crank": "0.3 m", "coupler": "0.2 m", "rocker": "0.25 m", "ground": "0.3 m"}
    changes = {f"parameters.{name}": {"value": x, "tunable": True} for name, x in sizes.items()}
    start = repr(math.acos(-0.125)) + " rad"
    changes |= {"parameters.begin": start, "loop.inputs.theta1": "begin + speed*t/1e9"}
    changes |= {"loop.range": [start, "3 rad"], "loop.start": {"theta2": "-60 deg", "theta3": "40 deg"}}
    with pytest.raises(
        ModelError, match=r"at a singular position, such as a dead centre, at theta1 = 97\.18"
    ):
        build("planar_4r", set=changes).sensitivity(["theta2"], ["coupler"], at=0.0)


def test_derivatives_at_several_times_are_those_at_each():
    model = build("rssr")
    found = model.sensitivity(["theta4", "theta1.drive"], t_eval=[0.1, 0.4, 0.05])
    assert found.derivatives.shape == (3, 2, len(model.parameters)) and found.values.shape == (3, 2)
    for k, t in enumerate(found.t):
        one = model.sensitivity(["theta4", "theta1.drive"], at=t)
        assert found.values[k] == pytest.approx(one.values, rel=1e-12)
        assert found.derivatives[k] == pytest.approx(one.derivatives, rel=1e-11)
    for wrong, message in ({"at": 0.1, "t_eval": [0.2]}, "not both"), ({"t_eval": []}, "expected times"):
        with pytest.raises(ModelError, match=message):
            model.sensitivity(["theta4"], **wrong)
