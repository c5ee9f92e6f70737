"""The shipped scenes by kind."""

from __future__ import annotations

import symgen
from symgen.runtime.elastic_model import ElasticModel
from symgen.scene.loading import read_scene

#: Scenes with a link-joint table, and scenes of points and links.
LOOPS = [name for name in symgen.shipped_scenes() if "loop" in read_scene(name).data]
LINKAGES = [name for name in symgen.shipped_scenes() if name not in LOOPS]


def rigid(model):
    """The linkage with all its links rigid."""
    return model.rigid if isinstance(model, ElasticModel) else model
