"""Designs of sweeps: the parameter values of every run, by the number of the run."""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ModelError, check_known, shown
from symgen.runtime.arrays import Array

if TYPE_CHECKING:
    from scipy.stats.qmc import Sobol

#: Runs whose random numbers come from one generator.
_BLOCK = 1024
#: Normal distributions: half the interval of a worst case, in standard deviations.
WIDTH = 3.0
SAMPLINGS = ("grid", "list", "random", "latin-hypercube", "sobol")


@dataclass(frozen=True, slots=True)
class Uniform:
    """A uniform distribution between two values in SI units."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not (_is_number(self.low) and _is_number(self.high) and self.low < self.high):
            raise ModelError(
                "expected a uniform distribution from a lower to a higher finite value, "
                f"got {self.low!r} and {self.high!r}"
            )

    @property
    def bounds(self) -> tuple[float, float]:
        """Its least and greatest value."""
        return self.low, self.high

    def quantiles(self, shares: Array) -> Array:
        """Return its values below which it has the shares, 0 to 1."""
        return self.low + (self.high - self.low) * shares


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution with mean and standard deviation in SI units."""

    mean: float
    deviation: float

    def __post_init__(self) -> None:
        if not (_is_number(self.mean) and _is_number(self.deviation) and self.deviation > 0.0):
            raise ModelError(
                "expected a normal distribution with a finite mean and a standard deviation above zero, "
                f"got {self.mean!r} and {self.deviation!r}"
            )

    @property
    def bounds(self) -> tuple[float, float]:
        """The mean less and plus three standard deviations."""
        return self.mean - WIDTH * self.deviation, self.mean + WIDTH * self.deviation

    def quantiles(self, shares: Array) -> Array:
        """Return its values below which it has the shares, 0 to 1 without the ends."""
        from scipy.special import ndtri

        quantiles: Array = ndtri(np.clip(shares, 2.0**-54, 1.0 - 2.0**-53))
        return self.mean + self.deviation * quantiles


Distribution = Uniform | Normal


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, slots=True)
class Grid:
    """Every combination of some values of each parameter; those of the last change fastest."""

    names: tuple[str, ...]
    axes: tuple[Array, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of values."""
        return tuple(len(axis) for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of runs."""
        return math.prod(self.shape)

    @property
    def identity(self) -> dict[str, Any]:
        """The names, the numbers of values, and their hash."""
        return {"sampling": "grid", "names": self.names, "shape": self.shape, "values": _hash(self.axes)}

    def values(self, first: int, last: int) -> Array:
        """Return the values of the runs first to last - 1, (runs, parameters)."""
        places = np.unravel_index(np.arange(first, last), self.shape)
        return np.stack([axis[at] for axis, at in zip(self.axes, places, strict=True)], axis=1)


@dataclass(frozen=True, slots=True)
class Listed:
    """A list of values of each parameter, one per run: (runs, parameters)."""

    names: tuple[str, ...]
    rows: Array

    @property
    def count(self) -> int:
        """Number of runs."""
        return len(self.rows)

    @property
    def identity(self) -> dict[str, Any]:
        """The names, the number of runs, and the hash of their values."""
        return {"sampling": "list", "names": self.names, "count": self.count, "values": _hash([self.rows])}

    def values(self, first: int, last: int) -> Array:
        """Return the values of the runs first to last - 1, (runs, parameters)."""
        return self.rows[first:last]


class Sampled:
    """Samples of distributions: random, a Latin hypercube, or a scrambled Sobol sequence.

    The values of a run depend on the seed and the number of the run alone; those of a Latin hypercube also on
    the number of runs, and the whole hypercube is held in memory.
    """

    def __init__(self, of: Mapping[str, Distribution], sampling: str, count: int, seed: int) -> None:
        self.of, self.sampling, self.count, self.seed = dict(of), sampling, count, seed
        self.names = tuple(of)
        self._hypercube: Array | None = None
        self._sequence: Sobol | None = None

    @property
    def identity(self) -> dict[str, Any]:
        """The distributions, the kind of samples, their number and the seed."""
        of = {name: repr(distribution) for name, distribution in self.of.items()}
        return {"sampling": self.sampling, "of": of, "count": self.count, "seed": self.seed}

    def values(self, first: int, last: int) -> Array:
        """Return the values of the runs first to last - 1, (runs, parameters)."""
        shares = {"random": self._random, "latin-hypercube": self._latin, "sobol": self._sobol}[self.sampling]
        fractions = shares(first, last)
        return np.stack([d.quantiles(fractions[:, i]) for i, d in enumerate(self.of.values())], axis=1)

    def _random(self, first: int, last: int) -> Array:
        blocks = range(first // _BLOCK, (last - 1) // _BLOCK + 1)
        size = (_BLOCK, len(self.names))
        drawn = np.concatenate([np.random.default_rng([self.seed, b]).random(size) for b in blocks])
        return drawn[first - blocks[0] * _BLOCK : last - blocks[0] * _BLOCK]

    def _latin(self, first: int, last: int) -> Array:
        from scipy.stats.qmc import LatinHypercube

        if self._hypercube is None:
            generator = np.random.default_rng(self.seed)
            self._hypercube = LatinHypercube(len(self.names), seed=generator).random(self.count)
        return self._hypercube[first:last]

    def _sobol(self, first: int, last: int) -> Array:
        from scipy.stats.qmc import Sobol

        if self._sequence is None or self._sequence.num_generated > first:
            self._sequence = Sobol(len(self.names), seed=np.random.default_rng(self.seed))
        if first > self._sequence.num_generated:
            self._sequence.fast_forward(first - self._sequence.num_generated)
        with warnings.catch_warnings():  # samples of other sizes than powers of two are less even, not wrong
            warnings.simplefilter("ignore", UserWarning)
            points: Array = self._sequence.random(last - first)
        return points


Design = Grid | Listed | Sampled


def _hash(arrays: Sequence[Array]) -> str:
    digest = hashlib.sha256()
    for values in arrays:
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def design_of(vary: Mapping[str, Any], sampling: str | None, count: int | None, seed: int) -> Design:
    """Return the design of a sweep; see :meth:`symgen.Model.sweep`.

    Raises
    ------
    ModelError
        For values that are neither finite numbers nor a distribution, lists of unequal length, an unknown
        sampling, or a number of runs that is missing or without effect.
    """
    if not vary:
        raise ModelError("expected parameters to vary, with values or a distribution each; got none")
    drawn = [name for name, values in vary.items() if isinstance(values, Distribution)]
    chosen = sampling or ("sobol" if drawn else "grid")
    check_known(chosen, SAMPLINGS, "there is no sampling")
    if chosen in ("grid", "list"):
        if drawn:
            raise ModelError(f"a {chosen} needs values of {drawn[0]}, got a distribution")
        if count is not None:
            raise ModelError(f"the values of a {chosen} give the number of runs: omit the count of {count}")
        axes = tuple(np.atleast_1d(_numbers(name, values)) for name, values in vary.items())
        if chosen == "grid":
            return Grid(tuple(vary), axes)
        most = max(map(len, axes))
        short = [name for name, axis in zip(vary, axes, strict=True) if len(axis) not in (1, most)]
        if short:
            raise ModelError(f"expected {most} values of {short[0]}, one per run, or one for all")
        return Listed(tuple(vary), np.stack([np.broadcast_to(axis, most) for axis in axes], axis=1))
    fixed = [name for name in vary if name not in drawn]
    if fixed:
        raise ModelError(
            f"{chosen} samples need a distribution of {fixed[0]}, such as Uniform(low, high), "
            f"got {shown(vary[fixed[0]])}"
        )
    most = 10**8 if chosen == "latin-hypercube" else 10**12
    if count is None or not 1 <= count <= most:
        raise ModelError(
            f"expected a number of runs of {chosen} samples, 1 to {most:g}, got {count}\n"
            f"  Give the count, on the command line after --{chosen}."
        )
    if seed < 0:
        raise ModelError(f"expected a seed of 0 or more, got {seed}")
    return Sampled(vary, chosen, count, seed)


def _numbers(name: str, numbers: Any) -> Array:
    try:
        values = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        values = np.array(np.nan)
    if values.ndim > 1 or not values.size or not np.all(np.isfinite(values)):
        raise ModelError(
            f"expected finite values of {name} in SI units, or a distribution, got {shown(numbers)}"
        )
    return values
