"""The suite of hard cases: what must hold does, what fails is told, and the suite itself can fail."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError
from symgen.runtime.elastic_model import METHODS
from symgen.runtime.integrators import INTEGRATORS
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve_linkage
from symgen.study import stability
from symgen.study.stability import CASES, Trial, chosen, go_through, run_suite
from symgen.study.stability.case import Found
from symgen.study.stability.page import page
from symgen.study.stability.truths import compound_pendulum, exact_accelerations

DOCS = Path(__file__).resolve().parents[2] / "docs"
TRIALS = [(case, trial) for case in CASES for trial in case.trials]


@cache
def found_in(name, label):
    return next(go_through(c, t) for c, t in TRIALS if (c.name, t.label) == (name, label))


def outcome(case, trial):
    """Go through a trial once in a session."""
    return found_in(case.name, trial.label)


@pytest.mark.parametrize(
    ("case", "trial"), TRIALS, ids=[f"{c.name}-{t.label}".replace(" ", "_") for c, t in TRIALS]
)
def test_what_must_hold_does(case, trial):
    found = outcome(case, trial)
    assert found.holds, (found.found, found.said)
    if not found.survived:
        assert not found.required
        assert len(found.said) > 20


def test_every_integrator_goes_through_every_motion():
    for case in CASES:
        methods = {trial.method for trial in case.trials}
        if case.family == "rods":
            assert methods >= set(INTEGRATORS)
        elif case.name == "cssp":
            assert methods >= {"dop853", "dopri5", "rk4"}
        elif len(case.trials) > 2:
            assert methods == set(METHODS) - {"quasi-static", "periodic"}


def test_names_are_of_one_case_each():
    assert len({case.name for case in CASES}) == len(CASES)


def test_honest_failures_are_there():
    """Too long a step fails where a shorter one does not: said, or by an error that is plain to see."""
    whip = next(c for c in CASES if c.name == "whip")
    assert not outcome(whip, whip.trials[-1]).survived
    parallelogram = next(c for c in CASES if c.name == "parallelogram")
    coarse = next(t for t in parallelogram.trials if t.options.get("step") == 5e-2)
    assert outcome(parallelogram, coarse).found.error > 1e-2


def test_the_suite_can_fail():
    """A wrong truth, a drift, an end before the end: each is what does not hold."""
    case = next(c for c in CASES if c.name == "mass_ratios")
    (trial, *_) = case.trials
    assert not go_through(replace(case, error=lambda *_: 1.0), trial).holds
    assert not go_through(replace(case, error=lambda *_: math.nan), trial).holds
    assert not go_through(replace(case, most_drift=0.0), trial).holds
    assert not go_through(case, replace(trial, options={"rtol": 1e-10, "max_steps": 1})).holds
    assert go_through(case, replace(trial, bound=None)).holds


def test_choosing():
    assert chosen([]) == CASES
    assert {c.family for c in chosen(["loops"])} == {"loops"}
    assert [c.name for c in chosen(["double_four_bar all round"])] == ["double_four_bar all round"]
    assert len(chosen(["double_four_bar"])) == 4
    with pytest.raises(ModelError, match="there is no hard case 'bennet'.*Did you mean 'bennett'"):
        chosen(["bennet"])


def test_the_page_is_of_these_cases():
    """Names, methods and bounds; numbers may differ in the last place between machines."""
    text = (DOCS / "stability.md").read_text(encoding="utf-8")
    assert [line[4:] for line in text.splitlines() if line.startswith("### ")] == [c.name for c in CASES]
    rows = [line.split("|") for line in text.splitlines() if line.startswith("| ") and "method" not in line]
    assert [row[1].strip() for row in rows] == [t.label for _, t in TRIALS]
    assert not any("NOT" in line for line in text.splitlines())


def test_numbers_on_the_page():
    """Rounded up to powers of ten, so that what did not change stays."""
    case = next(c for c in CASES if c.name == "mass_ratios")
    made = stability.Outcome(case, Trial("dop853", {"rtol": 1e-9}, 1e-6), Found(2.1e-9, 3e-16, 1234, 1.0), "")
    row = next(line for line in page([made]).splitlines() if line.startswith("| dop853"))
    assert row == "| dop853, rtol 1e-09 | yes | 1e-08 | round-off | 1200 | <= 1e-06 |"
    failed = stability.Outcome(case, Trial("rk4"), None, "it broke")
    assert "| rk4 | **no** | - | - | - |  |" in page([failed])
    assert "*rk4*: it broke." in page([failed])


def test_command(tmp_path):
    file = tmp_path / "page.md"
    done = CliRunner().invoke(app, ["stability", "--cases", "bennett,bricard", "--json", "--out", str(file)])
    assert done.exit_code == 0, done.output
    data = json.loads(done.stdout)
    assert data["holds"] is True
    assert [(o["case"], o["survived"]) for o in data["outcomes"]] == [("bennett", True), ("bricard", True)]
    assert "### bricard" in file.read_text()
    shown = CliRunner().invoke(app, ["stability", "--cases", "planar_4r"])
    assert shown.exit_code == 0
    assert "cannot be followed beyond theta1 = -41.40962" in shown.stdout.replace("\n", " ")
    assert "1 of 2 rows have a bound" in shown.stdout


def test_command_fails_where_something_does_not_hold(monkeypatch):
    case = next(c for c in CASES if c.name == "bennett")
    monkeypatch.setattr(stability, "CASES", (replace(case, bound=1e-30),))
    done = CliRunner().invoke(app, ["stability"])
    assert done.exit_code == 1
    assert "Does not hold: bennett, pose by pose." in done.stdout


def test_progress():
    seen = []
    run_suite(chosen(["bennett", "bricard"]), seen.append)
    assert seen == [0.5, 1.0]


def test_exact_accelerations_know_rods():
    """Of one rod: 3/2 g at its end; of a straight chain of two: the closed form."""
    scene = load_scene("collinear_chain")
    model = symgen.build(scene)
    exact = exact_accelerations(resolve_linkage(scene), model.initial_state())
    # Level chains of many rods: the first end falls with (3 - sqrt(3)) g, to what ten rods leave.
    assert float(exact["P1"][1]) == pytest.approx(-9.81 * (3 - 3**0.5), rel=1e-5)
    angles = compound_pendulum(np.linspace(0, 1, 5), 0.3, 0.0, 1.0, 2.0)
    energy = 9.81 * (math.sin(0.3) - np.sin(angles))
    assert angles[0] == 0.3 and np.all(energy >= 0)
