"""The method of a run when none is given: by tolerance and scene, and another one where the first cannot continue."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared.linkages import at, ground
from shared.loop_scenes import freed

import symgen
from symgen.errors import ModelError, SimulationError

CASES = Path(__file__).parents[2] / "cases"


def method_of(model, **options):
    return model.simulate(**options).provenance["method"]


@pytest.mark.parametrize(
    ("options", "method"),
    [
        ({}, "taylor"),
        ({"rtol": 1e-7}, "taylor"),
        ({"rtol": 2e-7}, "dop853"),
        ({"rtol": 1e-12, "max_step": 0.01}, "taylor"),
        ({"rtol": 1e-12, "stabilisation": "baumgarte"}, "dop853"),
        ({"rtol": 1e-12, "method": "dop853"}, "dop853"),
        ({"step": 1e-3}, "dop853"),
    ],
)
def test_by_tolerance(options, method):
    assert method_of(symgen.build("four_bar"), **options) == method


def test_of_loops():
    """Where the power series of a loop end, another method repeats the run: the message has its number of steps."""
    tables, options = freed("rssr", 0.5, 3.0), {"t_end": 0.1}
    model = symgen.build(symgen.Scene(**tables))
    assert method_of(model, t_end=0.1, rtol=2e-7) == "dop853"
    assert method_of(model, **options) == "taylor"
    assert method_of(symgen.build(symgen.Scene(**tables), backend="numpy"), **options) == "dop853"
    tables["parameters"]["c"] = "0.1 N*m"
    tables["loop"]["drives"] = {"theta1": "c*((theta1 - 0.8)**4)**0.3"}
    model, messages = symgen.build(symgen.Scene(**tables)), []
    for method in ("taylor", "dop853", None):
        with pytest.raises(SimulationError, match="the step became too small") as failed:
            model.simulate(method=method, **options)
        messages.append(str(failed.value))
    assert messages[0] != messages[1] == messages[2]


def test_the_default_tolerance_of_float32_is_larger():
    assert method_of(symgen.build("four_bar", precision="float32")) == "dop853"


@pytest.mark.parametrize(
    ("of", "rtol", "method"),
    [("A.y", 1e-7, "taylor"), ("abs(A.y)", 1e-12, "dop853"), ("abs(A.y)", 1e-13, "taylor")],
)
def test_events_without_series(of, rtol, method):
    """Steps of power series are short with them."""
    scene = symgen.Scene(
        points={"O": ground(0, 0), "A": at(1, 0)},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        events=[{"name": "level", "of": of, "value": "-0.5 m"}],
    )
    assert method_of(symgen.build(scene), t_end=0.1, rtol=rtol) == method


def test_only_compiled_kernels_have_series():
    assert method_of(symgen.build("four_bar", backend="numpy"), rtol=1e-10) == "dop853"


def test_no_series_of_many_rods():
    """Their compilation would take longer than that of all other kernels."""
    ground = {"at": ["0 m", "0 m"], "ground": True}
    points = {"P0": ground, **{f"P{i}": {"at": [f"{i} m", "0 m"]} for i in range(1, 202)}}
    links = {f"r{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": "1 kg"} for i in range(201)}
    model, options = symgen.build(symgen.Scene(points=points, links=links)), {"t_end": 1e-3, "rtol": 1e-10}
    assert method_of(model, **options) == "dop853"
    with pytest.raises(ModelError, match="fewer than about 100 rods"):
        model.simulate(method="taylor", **options)


def test_digits_of_float128():
    """Steps of dop853 would be too short."""
    model = symgen.build("four_bar", precision="float128")
    result = model.simulate(t_end=0.5, rtol=1e-26, samples=2)
    assert result.provenance["method"] == "taylor"
    assert result.drift.energy < 1e-24  # [J], of about 1 J


def through_a_spring():
    """A slider passes the other end of a spring, whose force jumps there: power series end, and dop853 passes."""
    return symgen.Scene(
        points={"O": ground(0, 0), "R": ground(-1, 0), "Q": ground(1, 0), "A": at(0.5, 0)},
        links={"rail": {"points": ["R", "Q"]}},
        masses=[{"point": "A", "mass": "1 kg"}],
        guides=[{"points": ["A"], "along": "rail"}],
        springs=[{"between": ["O", "A"], "stiffness": "100 N/m", "length": "0.1 m"}],
    )


def test_another_method_where_series_end():
    """The numbers are those of the other method."""
    model, options = symgen.build(through_a_spring()), {"rtol": 1e-12, "t_end": 2.0}
    with pytest.raises(SimulationError, match="try dop853"):
        model.simulate(method="taylor", **options)
    found, other = model.simulate(**options), model.simulate(method="dop853", **options)
    assert found.provenance["method"] == "dop853"
    assert found.statistics["steps"] == other.statistics["steps"]
    assert [v.values.tobytes() for v in found.variables] == [v.values.tobytes() for v in other.variables]


def test_neither_method_reaches_the_end():
    """The error is that of the other method."""
    model = symgen.build(CASES / "gap.toml")
    with pytest.raises(SimulationError, match="dead centre") as failed:
        model.simulate()
    with pytest.raises(SimulationError) as other:
        model.simulate(method="dop853")
    assert str(failed.value) == str(other.value)


def test_a_limit_of_steps_is_for_both_methods():
    with pytest.raises(SimulationError, match="20 steps") as failed:
        symgen.build("peaucellier_limit").simulate(max_steps=20)
    assert failed.value.partial.provenance["method"] == "taylor"


@pytest.mark.parametrize(
    ("scene", "method"),
    [
        ("four_bar", "taylor"),
        ("parallelogram", "taylor"),
        (through_a_spring(), "dop853"),
        (symgen.Scene(**freed("rssr", 0.5, 3.0)), "taylor"),
    ],
)
def test_resumed(scene, method, tmp_path):
    """By the method of the checkpoint; parallelogram takes steps of both near its losses of rank."""
    model, file, options = symgen.build(scene), tmp_path / "kept", {"rtol": 1e-12, "t_end": 200.0}

    def interrupt(part):
        if part > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="--resume .*kept continues it"):
        model.simulate(**options, checkpoint=file, checkpoint_every=1e9, progress=interrupt)
    found, whole = model.simulate(**options, resume=file), model.simulate(**options)
    assert found.provenance["method"] == whole.provenance["method"] == method
    assert all(
        np.array_equal(a.values, b.values) for a, b in zip(found.variables, whole.variables, strict=True)
    )
