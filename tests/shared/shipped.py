"""The shipped scenes by kind."""

from __future__ import annotations

from functools import cache

import symgen
from symgen.lowering.program import lower_system
from symgen.scene.loading import read_scene

#: Scenes with a link-joint table, and scenes of points and links.
LOOPS = [name for name in symgen.shipped_scenes() if "loop" in read_scene(name).data]
LINKAGES = [name for name in symgen.shipped_scenes() if name not in LOOPS]
#: Linkages some of whose links bend.
ELASTIC = [
    name
    for name in LINKAGES
    if any("elastic" in link for link in read_scene(name).data.get("links", {}).values())
]

#: Chains and parallel linkages of the same elements and constraints as others.
REPEATED = {
    "collinear_chain", "elastic_four_bar_free", "far_origin", "length_ratios", "parallelogram",
    "peaucellier_limit", "peaucellier_perturbed", "two_four_bars", "whip",
}  # fmt: skip


@cache
def _derived(name):
    return symgen.derive(name)


def derived(scene):
    """Return the system of a scene; one given by its name is derived once in a process: nothing changes it."""
    return _derived(scene) if isinstance(scene, str) else symgen.derive(scene)


@cache
def lowered(name):
    """Return its program, likewise."""
    return lower_system(derived(name))


def rigid(model):
    """Return the linkage with all its links rigid."""
    return getattr(model, "rigid", model)
