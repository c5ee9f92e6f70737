"""Arguments of analyses of elastic links: see :mod:`symgen.runtime.model.arguments`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from symgen.runtime.integrate.options import sample_count
from symgen.runtime.integrate.pace import Progress
from symgen.runtime.model.arguments import Checkpointed, Controlled

if TYPE_CHECKING:
    from symgen.runtime.result.state import State


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticArguments:
    """Elastic motion along the revolution of a crank."""

    at: ArrayLike | None = None
    form: str = "exact"
    geometric_stiffness: bool = True
    max_wall: float | None = None
    progress: Progress | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class QuasiStatic(ElasticArguments):
    """Elastic motion without its own inertia."""

    samples: int = 361
    revolutions: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _InSteps(ElasticArguments):
    steps: int | None = None
    rtol: float | None = None
    max_step: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Periodic(_InSteps):
    """Steady state."""

    samples: int = 361


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticRun(Controlled, Checkpointed, _InSteps):
    """Elastic motion in time."""

    method: str = "gauss"
    t_end: float | None = None
    samples: int | None = None
    t_eval: ArrayLike | None = None
    revolutions: float | None = None
    initial: str | Sequence[float] = "undeformed"

    @property
    def in_large_rotation(self) -> LargeRotation | None:
        """The same run in large rotation in place of linear theory; None for options that it lacks."""
        shared = {f.name for f in fields(LargeRotation)} & {f.name for f in fields(self)}
        others = ((getattr(self, f.name), f.default) for f in fields(self) if f.name not in shared)
        # A list or an array is no default.
        if any(np.ndim(value) or value != default for value, default in others):
            return None
        options = {name: getattr(self, name) for name in shared}
        return LargeRotation(**options | {"samples": sample_count(self.samples, None, 361)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Elements in large rotation, with steps by their error."""

    rtol: float | None = None
    samples: int = 361
    max_step: float | None = None
    max_wall: float | None = None
    progress: Progress | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LargeRotation(Checkpointed, Refined):
    """Elastic links in large rotation."""

    elements: int | None = None
    t_end: float | None = None
    revolutions: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class RunInSpace(Controlled, Refined):
    """Elastic links in space."""

    t_end: float | None = None
    initial: str | Sequence[float] = "undeformed"


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemStepping:
    """A motion in large rotation that advances by calls."""

    rtol: float | None = None
    step: float | None = None
    state: State | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticStepping(SystemStepping):
    """The same in the plane."""

    elements: int | None = None
