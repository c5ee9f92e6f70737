"""Names of outputs are checked before the steps; those of runs by linear theory are omitted elsewhere."""

from __future__ import annotations

import pytest
from shared.commands import runner
from shared.in_numpy import build

import symgen
from symgen.cli import app
from symgen.errors import SceneError
from symgen.runtime.elastic import run as linear
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.scene.loading import read_scene

BLADE = {
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": ["1 m", "0 m"]}},
    "links": {
        "blade": {
            "points": ["O", "tip"],
            "density": "7850 kg/m^3",
            "section": {"width": "0.05 m", "thickness": "0.005 m"},
            "elastic": {"E": "210e9 Pa"},
        }
    },
    "crank": {"link": "blade", "speed": "0 rpm"},
    "forces": [{"point": "tip", "force": ["0 N", "-5 N"]}],
}
#: Outputs of runs by linear theory alone.
ALONE = ["blade.greatest_stress", "blade.tip.rotation"]


def blade(*outputs):
    return build(symgen.Scene(**BLADE, analysis={"t_end": "1 ms", "outputs": list(outputs)}))


@pytest.fixture
def no_steps(monkeypatch):
    def refused(*_, **__):
        raise AssertionError("steps were taken")

    monkeypatch.setattr(SystemRun, "run", refused)
    monkeypatch.setattr(linear, "adapted", refused)


def test_equilibria_and_large_rotation_omit_outputs_of_runs():
    model = blade(*ALONE, "tip.position")
    at_rest, large, run = model.equilibrium(), model.large_rotation(samples=2, elements=1), model.simulate()
    assert list(at_rest.outputs) == [v.name for v in large.variables] == ["tip.position"]
    assert [v.name for v in run.variables] == [*ALONE, "tip.position"]
    for notes in (at_rest.notes, large.notes):
        assert [x for x in notes if x.endswith(f"omitted: {', '.join(ALONE)}")]
    assert not [x for x in run.notes if "omitted:" in x]


@pytest.mark.parametrize("analysis", ["large_rotation", "equilibrium"])
def test_outputs_that_leave_nothing_are_refused_before_the_steps(analysis, no_steps):
    with pytest.raises(
        SceneError, match=r"this analysis has no output 'blade.greatest_stress'(.|\n)*simulate"
    ):
        getattr(blade(*ALONE), analysis)()


@pytest.mark.parametrize("analysis", ["simulate", "large_rotation", "equilibrium"])
def test_unknown_outputs_are_refused_before_the_steps(analysis, no_steps):
    """Names of elastic links are known with their elements only."""
    with pytest.raises(SceneError, match="have no output 'blde.greatest_stress'"):
        getattr(blade("blde.greatest_stress", "tip.position"), analysis)()


def test_a_rigid_crank_with_a_motor_has_no_torque(no_steps):
    data = read_scene("thesis_rig").data
    crank = {"link": "crank", "mode": "motor", "speed": data["crank"]["speed"], "torque": "0.1 N*m"}
    model = build(symgen.Scene(**data | {"crank": crank, "analysis": {"outputs": ["crank.torque"]}}))
    with pytest.raises(SceneError, match=r"have no output 'crank.torque'.*shaft_power"):
        model.simulate()


def test_outputs_of_the_command_line_are_not_omitted(no_steps):
    names = "coupler.greatest_stress,B.position"
    done = runner.invoke(app, ["large-rotation", "elastic_four_bar", "--of", names])
    assert done.exit_code == 1
    assert "this analysis has no output 'coupler.greatest_stress'" in str(done.exception)
