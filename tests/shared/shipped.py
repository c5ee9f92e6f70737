"""The shipped scenes by kind."""

from __future__ import annotations

import symgen
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


def rigid(model):
    """Return the linkage with all its links rigid."""
    return getattr(model, "rigid", model)
