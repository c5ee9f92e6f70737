"""symgen: symbolic equations of motion of mechanisms, printed as C, run compiled.

>>> import symgen
>>> model = symgen.build("peaucellier")
>>> run = model.simulate(t_end=1.0, rtol=1e-10)

Importing the package is cheap: each name below is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from symgen.version import __version__

if TYPE_CHECKING:
    from symgen.errors import SymgenError as SymgenError
    from symgen.pipeline.build import build as build
    from symgen.pipeline.chain import build_chain as build_chain
    from symgen.pipeline.systems import derive as derive
    from symgen.runtime.chain.chain import Chain as Chain
    from symgen.runtime.elastic.model import ElasticModel as ElasticModel
    from symgen.runtime.integrate.controller import MotionView as MotionView
    from symgen.runtime.loop.model import LoopModel as LoopModel
    from symgen.runtime.model.model import Model as Model
    from symgen.runtime.model.system import SystemModel as SystemModel
    from symgen.runtime.result.files import load_result as load_result
    from symgen.runtime.result.result import Result as Result
    from symgen.runtime.rods.model.general import GeneralModel as GeneralModel
    from symgen.runtime.rods.model.kinematic import KinematicModel as KinematicModel
    from symgen.runtime.rods.model.rods import RodModel as RodModel
    from symgen.runtime.sweeps.designs import Normal as Normal
    from symgen.runtime.sweeps.designs import Uniform as Uniform
    from symgen.scene.loading import load_scene as load_scene
    from symgen.scene.loading import shipped_scenes as shipped_scenes
    from symgen.scene.schema import Scene as Scene
    from symgen.synthesis.synthesise import synthesise as synthesise

_HOME = {
    "Chain": "symgen.runtime.chain.chain",
    "ElasticModel": "symgen.runtime.elastic.model",
    "GeneralModel": "symgen.runtime.rods.model.general",
    "KinematicModel": "symgen.runtime.rods.model.kinematic",
    "LoopModel": "symgen.runtime.loop.model",
    "MotionView": "symgen.runtime.integrate.controller",
    "Model": "symgen.runtime.model.model",
    "Normal": "symgen.runtime.sweeps.designs",
    "Result": "symgen.runtime.result.result",
    "RodModel": "symgen.runtime.rods.model.rods",
    "Scene": "symgen.scene.schema",
    "SymgenError": "symgen.errors",
    "SystemModel": "symgen.runtime.model.system",
    "Uniform": "symgen.runtime.sweeps.designs",
    "build": "symgen.pipeline.build",
    "build_chain": "symgen.pipeline.chain",
    "derive": "symgen.pipeline.systems",
    "load_result": "symgen.runtime.result.files",
    "load_scene": "symgen.scene.loading",
    "shipped_scenes": "symgen.scene.loading",
    "synthesise": "symgen.synthesis.synthesise",
}

__all__ = ["__version__", *_HOME]  # noqa: PLE0604 - the keys are strings


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'symgen' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
