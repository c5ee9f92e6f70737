"""Kernels in a model's own number type, in addition to those in double precision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from symgen.precision import FLOAT64, Precision
from symgen.runtime._core import DOUBLE, Core
from symgen.runtime.kernels.library import Library


@dataclass(frozen=True, slots=True)
class Typed:
    """Kernels of one scene in one type.

    Parameters
    ----------
    precision
        The type of their numbers.
    digits
        Digits of kernels in mpmath, which have no such type; 0 for all others.
    kernels
        Function of one or two flags; returns the kernels, built on first use: batched if the first is true,
        else of one state; batched with power series if the second is true.
    core
        Function that returns the core of runs in the type, built on first use.
    """

    precision: Precision
    digits: int
    kernels: Callable[..., Library]
    core: Callable[[], Core]

    @property
    def is_plain(self) -> bool:
        """Whether all other calls use the same kernels."""
        return not self.digits and self.precision is FLOAT64

    @property
    def stepping(self) -> Core:
        """The core that runs of these kernels go through; those in mpmath hand it doubles."""
        return DOUBLE if self.is_plain or self.digits else self.core()


def library_of_runs(library: Library, typed: Typed | None) -> Library:
    """Return the kernels of runs: the typed kernels if given."""
    return typed.kernels(False) if typed and not typed.is_plain else library


def build_settings(library: Library, typed: Typed | None) -> dict[str, str]:
    """Return backend and build settings of the kernels of runs: of the typed kernels if given."""
    chosen = library_of_runs(library, typed)
    return {"backend": chosen.backend, **chosen.provenance}
