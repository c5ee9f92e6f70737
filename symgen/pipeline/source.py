"""Origin of a model, from which it derives its equations and is restored in another process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from symgen.scene.loading import SceneText


@dataclass(frozen=True, slots=True)
class Source:
    """Scene and options of a build.

    Attributes
    ----------
    scene
        The scene as it was built; the path of a Python file for user-defined systems.
    options
        Options of :func:`symgen.build`, in order.
    derive, build
        Functions that derive the matrices of a scene by name, and build its model.
    rigid
        Whether the model is the rigid linkage of a scene with elastic links.
    """

    scene: SceneText | str
    options: tuple[Any, ...]
    derive: Callable[[SceneText | str], Mapping[str, Any]]
    build: Callable[[SceneText | str, tuple[Any, ...]], Any]
    rigid: bool = False

    def __call__(self) -> Mapping[str, Any]:
        """Return the derived matrices by name."""
        return self.derive(self.scene)

    def restored(self, parameters: Mapping[str, float]) -> Any:
        """Return the model with these parameters; its kernels are taken from the cache."""
        model = self.build(self.scene, self.options)
        return (model.rigid if self.rigid else model).with_parameters(**parameters)
