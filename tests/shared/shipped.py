"""The shipped scenes by kind; systems and programs of scenes and building blocks, each derived once."""

from __future__ import annotations

import os
import pickle
from functools import cache
from pathlib import Path

import symgen
from symgen.lowering.program import lower_system
from symgen.models import BLOCKS
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
#: Scenes with elastic links in space, which have neither exports nor other number types.
IN_SPACE = [
    n for n in ELASTIC if any(len(p.get("at", ())) == 3 for p in read_scene(n).data["points"].values())
]
OF_ALL_TYPES = [name for name in symgen.shipped_scenes() if name not in IN_SPACE]

#: Chains and parallel linkages of the same elements and constraints as others.
REPEATED = {
    "collinear_chain", "elastic_four_bar_free", "far_origin", "length_ratios", "parallelogram",
    "peaucellier_limit", "peaucellier_perturbed", "thesis_rig", "two_four_bars", "whip",
}  # fmt: skip


#: Folder that processes of one session share derived systems through; set by ``conftest.py``.
FOLDER: list[Path] = []


def _once(name, make):
    """Return the object made for a name, by this or another process of the session."""
    file = FOLDER[0] / f"{name}.pickle" if FOLDER else None
    if file and file.exists():
        return pickle.loads(file.read_bytes())
    made = make()
    if file:
        whole = file.with_name(f"{name}.{os.getpid()}")
        whole.write_bytes(pickle.dumps(made))
        whole.replace(file)
    return made


@cache
def _derived(name):
    return _once(f"{name}-system", lambda: BLOCKS[name]() if name in BLOCKS else symgen.derive(name))


def derived(scene):
    """Return the system of a scene or block; one given by its name is derived once: nothing changes it."""
    return _derived(scene) if isinstance(scene, str) else symgen.derive(scene)


@cache
def lowered(name):
    """Return its program, likewise."""
    return _once(f"{name}-program", lambda: lower_system(derived(name)))


def rigid(model):
    """Return the linkage with all its links rigid."""
    return getattr(model, "rigid", model)
