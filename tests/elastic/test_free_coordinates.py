"""Elastic links in open chains with free coordinates, which large rotation integrates with the rigid ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared.chain_pendulum import ChainPendulum, extrapolated

import symgen
from symgen.errors import ModelError, ResultError, SimulationError
from symgen.export import exported
from symgen.inspection.live import live_of
from symgen.pipeline.build import text_of
from symgen.runtime.integrate.pace import Pace
from symgen.runtime.result.elastic import ElasticResult

E, WIDTH, THICK, DENSITY, GRAVITY = 210e9, 20e-3, 1e-3, 7850.0, 9.81
ONE, TWO, TIP, MASS = 0.5, 0.4, 0.1, 1.0


def pendulum(**more):
    """A rigid rod hinged to the ground, and a strip hinged to its end, horizontal and at rest."""
    return symgen.Scene(
        **{
            "title": "Double pendulum with an elastic strip",
            "gravity": {"acceleration": ["0 m/s^2", f"{-GRAVITY} m/s^2"]},
            "points": {
                "O": {"at": ["0 m", "0 m"], "ground": True},
                "A": {"at": [f"{ONE} m", "0 m"]},
                "B": {"at": [f"{ONE + TWO} m", "0 m"]},
            },
            "links": {
                "one": {"points": ["O", "A"], "mass": f"{MASS} kg"},
                "two": {
                    "points": ["A", "B"],
                    "density": f"{DENSITY} kg/m^3",
                    "section": {"width": f"{WIDTH} m", "thickness": f"{THICK} m"},
                    "elastic": {"E": f"{E} Pa", "elements": 4},
                },
            },
            "masses": [{"point": "B", "mass": f"{TIP} kg"}],
            "crank": {"link": "one", "speed": "0 rpm", "mode": "free"},
            "analysis": {"t_end": "0.5 s"},
            **more,
        }
    )


def chain(rods, springs=(0.0, 0.0), **more):
    """Return the double pendulum with so many rods in place of the strip, with springs at O and at A."""
    h, mass = TWO / rods, DENSITY * WIDTH * THICK * TWO / rods
    bending = E * WIDTH * THICK**3 / 12 / h
    stiffness = [*springs, *[bending] * (rods - 1)]
    return ChainPendulum([ONE, *[h] * rods], [MASS, *[mass] * rods], stiffness, TIP, GRAVITY, **more)


def test_a_double_pendulum_with_an_elastic_link():
    """The default analysis is large rotation, and agrees with a chain of rigid rods, extrapolated."""
    run = symgen.build(pendulum()).simulate(samples=101)
    assert run.provenance["method"] == "large-rotation"
    assert any("does not determine the rigid motion of B" in note for note in run.notes)
    assert run.drift.energy < 1e-7 * run.drift.energy_exchanged
    times = run.time
    tips = [c.tip(c.run(np.zeros(n + 1), times)) for n in (4, 8) for c in [chain(n)]]
    apart = np.abs(run["B.position"].values - extrapolated(tips))
    # The strip bends by 2 mm and its tip moves by 1.4 m. The difference, 2.6e-6 m, is the stretch of the strip,
    # which rigid rods do not have; the error of the chain is 3e-7 m.
    assert apart.max() < 1e-5


def test_options_of_linear_theory_are_refused():
    model = symgen.build(pendulum())
    for option in ({"method": "newmark"}, {"t_eval": np.array([0.0, 0.1])}, {"initial": [1e-3]}):
        with pytest.raises(ModelError, match=r"rigid motion of B: .*\n.*model.large_rotation\(elements=4\)"):
            model.simulate(**option)
    with pytest.raises(ModelError, match="t_end or revolutions, not both"):
        model.large_rotation(elements=2, t_end=0.1, revolutions=1)
    with pytest.raises(ModelError, match="expected t_end above zero, got -1"):
        model.large_rotation(elements=2, t_end=-1.0)


@pytest.mark.parametrize("write", [exported, lambda scene: live_of(text_of(scene), {}, 2)], ids=["C", "page"])
def test_exports_are_refused(write):
    """C and live pages are of linear theory; the page ended with an internal error."""
    mass = {"bob": {"value": "1 kg", "tunable": True}}
    scene = pendulum(parameters=mass, masses=[{"point": "B", "mass": "bob"}])
    with pytest.raises(ModelError, match="rigid motion of B: linear theory needs a rigid motion"):
        write(scene)


LENGTH, THICKNESS, STIFF = 0.4, 20e-3, 5.0


def winding(rigid, speed, damping):
    """A link on a torsion spring, thrown so that it makes more than one revolution: elastic, or welded to a rigid hub."""
    bar = {
        "density": f"{DENSITY} kg/m^3",
        "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"},
        "elastic": {"E": f"{E} Pa"},
    }
    points = {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": [f"{LENGTH / 4} m", "0 m"]},
        "B": {"at": [f"{LENGTH} m", "0 m"]},
    }
    spring = {"stiffness": f"{STIFF} N*m", "damping": f"{damping} N*m*s"}
    if rigid:
        links = {"hub": {"points": ["O", "A"], **bar}, "bar": {"points": ["A", "B"], **bar}}
        links["hub"].pop("elastic")
        given = {"links": links, "welds": [{"point": "A", "links": ["hub", "bar"]}]}
        given["torsion_springs"] = [{"link": "hub", **spring}]
    else:
        points.pop("A")
        given = {"links": {"bar": {"points": ["O", "B"], **bar}}}
        given["torsion_springs"] = [{"link": "bar", "point": "O", **spring}]
    crank = {"link": "hub" if rigid else "bar", "mode": "free", "speed": f"{speed!r} rad/s"}
    return symgen.Scene(title="Thrown link on a spring", points=points, crank=crank, **given)


def rates(rigid):
    """Return the rate of the oscillation [rad/s], and the moment of inertia; sections of the bar rotate."""
    bent = LENGTH * (3 / 4 if rigid else 1)
    inertia = DENSITY * WIDTH * (THICKNESS * LENGTH**3 / 3 + THICKNESS**3 / 12 * bent)
    return (STIFF / inertia) ** 0.5, inertia


@pytest.mark.parametrize(
    ("rigid", "damping"), [(False, 0.1), (True, 0.0)], ids=["on a section", "on a rigid link"]
)
def test_torsion_springs_count_revolutions(rigid, damping):
    """The angle is 1.2 revolutions times sin(w t) with w^2 = k/I, without damping."""
    rate, inertia = rates(rigid)
    speed, end = 2.4 * np.pi * rate, 0.6 * np.pi / rate
    run = symgen.build(winding(rigid, speed, damping)).large_rotation(
        elements=1, t_end=end, samples=21, rtol=0.5
    )
    decay = damping / (2 * inertia)
    damped = (rate**2 - decay**2) ** 0.5
    angle = speed / damped * np.exp(-decay * run.time) * np.sin(damped * run.time)
    assert angle.max() > 1.05 * 2 * np.pi
    expected = LENGTH * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # The couple of the spring at O and the inertia of the bar bend its end by 1.3e-3 of the length.
    assert np.abs(run["B.position"].values - expected).max() < 2e-3 * LENGTH
    assert run.drift.energy < 1e-6 * run.drift.energy_exchanged


class Interrupted(Exception):
    """Raised in the middle of a run."""


def test_runs_continue_from_checkpoints(tmp_path, monkeypatch):
    """Interrupted before the first sample, in the last run, with references of angles that have moved, and by wall
    time: the same bits."""
    monkeypatch.setattr(Pace, "chunk", lambda self: 1)
    rate, _ = rates(False)
    model = symgen.build(winding(False, 2.4 * np.pi * rate, 0.1))
    options, calls = {"elements": 1, "t_end": 0.6 * np.pi / rate, "samples": 9, "rtol": 0.5}, []
    whole = model.large_rotation(**options, progress=calls.append)
    early, file, late = (tmp_path / name for name in ("early.npz", "large.npz", "late.npz"))
    assert sum(part < 1 / 8 for part in calls) > 4
    for kept, steps in ((early, 4), (file, len(calls) - 200)):
        left = iter(range(steps))

        def progress(part, left=left):
            if next(left, None) is None:
                raise Interrupted

        with pytest.raises(Interrupted):
            model.large_rotation(**options, checkpoint=kept, checkpoint_every=0.0, progress=progress)
    with pytest.raises(SimulationError):
        model.large_rotation(**options, checkpoint=late, checkpoint_every=1e9, max_wall=0.2)
    # A slow machine may not come to the first step.
    for left_off in (early, file, *filter(Path.exists, [late])):
        run = model.large_rotation(**options, resume=left_off)
        for output in whole.variables:
            assert np.array_equal(run[output.name].values, output.values), output.name
        assert run.drift == whole.drift
        assert all(run.statistics[k] == whole.statistics[k] for k in ("steps", "corrections", "error"))
    with pytest.raises(ResultError, match="is the checkpoint of another run"):
        model.large_rotation(**options | {"elements": 2}, resume=file)


@pytest.mark.parametrize("max_wall", [1e-9, 0.02])
def test_the_rigid_motion_of_a_run_that_max_wall_ended(max_wall):
    """Displacements are from the rigid motion, which is integrated beyond the limit."""
    with pytest.raises(SimulationError, match="wall time") as caught:
        symgen.build(pendulum()).simulate(samples=201, rtol=1e-6, max_wall=max_wall)
    partial = caught.value.partial
    assert isinstance(partial, ElasticResult)
    assert np.all(np.isfinite(partial["A.displacement"].values))
    assert np.max(np.abs(partial["A.displacement"].values[0])) < 1e-12
