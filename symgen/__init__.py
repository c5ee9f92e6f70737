"""symgen: symbolic equations of motion of mechanisms, printed as C, run compiled.

>>> import symgen
>>> model = symgen.build("peaucellier")
>>> run = model.simulate(t_end=1.0, rtol=1e-10)

Importing the package is cheap: each name below is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from symgen.errors import SymgenError as SymgenError
    from symgen.pipeline import build as build
    from symgen.pipeline import derive as derive
    from symgen.runtime.chain import Chain as Chain
    from symgen.runtime.loop_model import LoopModel as LoopModel
    from symgen.runtime.model import Model as Model
    from symgen.runtime.result import Result as Result
    from symgen.runtime.result import load_result as load_result
    from symgen.scene.loading import load_scene as load_scene
    from symgen.scene.loading import shipped_scenes as shipped_scenes
    from symgen.scene.schema import Scene as Scene

_HOME = {
    "Chain": "symgen.runtime.chain",
    "LoopModel": "symgen.runtime.loop_model",
    "Model": "symgen.runtime.model",
    "Result": "symgen.runtime.result",
    "Scene": "symgen.scene.schema",
    "SymgenError": "symgen.errors",
    "build": "symgen.pipeline",
    "derive": "symgen.pipeline",
    "load_result": "symgen.runtime.result",
    "load_scene": "symgen.scene.loading",
    "shipped_scenes": "symgen.scene.loading",
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
