"""Every shipped loop under Newton's and Euler's laws link by link, without screws: see ``loop_account``."""

from __future__ import annotations

from functools import cache

import pytest
from shared.loop_account import Account, account, largest

import symgen

SCENES = [name for name in symgen.shipped_scenes() if symgen.load_scene(name).loop is not None]
#: Components of joint forces that redundant constraints leave open, as many as the loop has: 6 less the rank.
OPEN = {"planar_4r": 3, "cardan": 3, "bennett": 3, "bricard": 1, "screw_jack": 4}
#: Offsets for the scene whose own are zero.
VALUES = {"slider_crank": {"a4": 0.508, "alpha4": 4.2, "S1": 0.2, "ratio": 2.0}}


@cache
def judged(name) -> Account:
    return account(symgen.load_scene(name), VALUES.get(name))


def test_all_loops_are_here():
    asked = {"slider_crank", "planar_4r", "cardan", "rssr", "rccc", "bennett", "bricard", "cssp"}
    assert asked <= set(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_motion_closes_the_table(name):
    judged(name).closes()


@pytest.mark.parametrize("name", SCENES)
def test_every_link_obeys_newton_and_euler(name):
    judged(name).links_obey_newton_and_euler()


@pytest.mark.parametrize("name", SCENES)
def test_joints_push_only_where_they_hold_or_are_driven(name):
    judged(name).joints_push_only_where_they_hold()


@pytest.mark.parametrize("name", SCENES)
def test_action_is_reaction(name):
    judged(name).action_is_reaction()
    judged(name).the_ground_is_shaken()


@pytest.mark.parametrize("name", SCENES)
def test_drives_and_loads_give_what_the_energy_takes(name):
    judged(name).powers_balance()


@pytest.mark.parametrize("name", [n for n in SCENES if n != "cssp"])
def test_what_nothing_determines_is_reported(name):
    j, count = judged(name), OPEN.get(name, 0)
    assert bool(j.run.indeterminate) == bool(count)
    assert j.open_components() == count
    # drives and motion are determined whatever is left open
    assert not [n for n in j.run.indeterminate if n.endswith((".drive", ".rate", ".acceleration"))]


def test_planar_loop_leaves_open_what_acts_across_its_plane():
    open_ = set(judged("planar_4r").run.indeterminate)
    assert {"coupler.joint2.force.z", "coupler.joint2.moment.x", "coupler.joint2.moment.y"} <= open_
    assert not {n for n in open_ if n.endswith(("force.x", "force.y", "moment.z"))}


def test_the_judge_can_fail():
    """A thousandth of the inertia of one link shows."""
    j = judged("rssr")
    force, _ = j.motion.inertia_wrench(1)
    wrenches = j.on_links()
    left = wrenches[1][0] - wrenches[2][0] - force
    assert largest(left) < 1e-9 < 1e-3 * largest(force)
