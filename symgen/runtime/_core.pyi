"""Types of the binding of the core; see ``_core.pyx`` for what things do."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime.arrays import Array
from symgen.runtime.kernels.library import Library

Raw = NDArray[np.uint8]
#: Numbers of t, q, u, p, work and out that a kernel reads or writes.
Sizes = tuple[int, int, int, int, int, int]

DONE: int
MORE: int
NOT_FINITE: int
STEP_TOO_SMALL: int
SINGULAR: int
PROJECTION_FAILED: int
CONTRADICTED: int
DRIFTED: int
ENDED: int
UNSOLVED: int
SLIDING: int
ENDS_RUN: int
REVOLVES: int
PROBED: int
WHICH_PIECE: int
STABILISATIONS: dict[str, int]
DOUBLE: Core

def call(
    address: int, sizes: Sizes, t: Array, q: Array, u: Array, p: Array, work: Array, out: Array
) -> None: ...
def set_up(address: int, p: Array, parameters: int, derived: int) -> None: ...
def evaluate(
    address: int, sizes: Sizes, t: float, q: Array, u: Array, p: Array, work: Array | None
) -> Array: ...
def call_many(
    address: int,
    sizes: Sizes,
    t: Array,
    y: Array,
    n: int,
    p: Array,
    work: Array,
    out: Array,
) -> None: ...
def call_at(address: int, sizes: Sizes, p: Array, out: Array) -> None: ...
def call_repeatedly(
    address: int, sizes: Sizes, times: int, y: Array, n: int, p: Array, work: Array, out: Array
) -> None: ...
def address_of(array: NDArray[Any]) -> int: ...

class Method(Protocol):
    @property
    def kind(self) -> str: ...
    @property
    def coefficients(self) -> Mapping[str, ArrayLike]: ...
    @property
    def adaptive(self) -> bool: ...
    @property
    def error_order(self) -> int: ...

def scheme_of(method: Method) -> tuple[tuple[int, ...], Array]: ...

class Core:
    def __init__(self, address: int = 0, owner: Any = None) -> None: ...
    name: str
    real_bytes: int
    epsilon: float
    def widen(self, high: ArrayLike, low: ArrayLike | None = None) -> Raw: ...
    def narrow(self, raw: Raw) -> tuple[Array, Array]: ...
    def call(
        self, address: int, sizes: Sizes, t: Raw, y: Raw, n: int, p: Raw, work: Raw, out: Raw
    ) -> None: ...

class Integrable:
    n: int
    m: int
    extra: int
    dim: int
    core_type: Core
    parameters: Array
    evaluations: int
    factorisations: int
    weakest: int
    soundness: float
    lost: int
    missed: float
    redundant: int
    rank_tolerance: float
    def solutions(self, t: Array, y: Array) -> Array: ...
    def derivative(self, t: float, y: Array) -> Array: ...
    def save(self) -> bytes: ...
    def restore(self, memory: bytes) -> None: ...
    def lost_rows(self) -> list[int]: ...
    def set_parameters(self, parameters: Array) -> None: ...
    def put(self, place: int, value: float) -> float: ...
    def check(self, t: float, y: Array) -> int: ...

class KernelEquations(Integrable):
    def __init__(
        self,
        library: Library,
        n: int,
        m: int,
        extra: int,
        p: Sequence[float] | Array,
        work_size: int,
        first_pivot: int,
        rank_tolerance: float,
        redundant: int,
        slack: float,
        *,
        core: Core = ...,
        series_rows: int = 0,
        series_watched: int = 0,
        events: int = 0,
        switches: int = 0,
        tables: int = 0,
        windings: int = 0,
        turns: int = 0,
        tangent: ArrayLike = (),
        tangent_library: Library | None = None,
        stabilisation: float = 0.0,
    ) -> None: ...

class Run:
    t: float
    t_end: float
    h: float
    dim: int
    recorded: int
    moved: int
    steps: int
    rejected: int
    ended_by: int
    switchings: int
    slid: int
    worst: int
    stiff: bool
    t_stiff: float
    blind: int
    t_blind: float
    position_drift: float
    velocity_drift: float
    energy_drift: float
    kinetic_min: float
    kinetic_max: float
    potential_min: float
    potential_max: float
    passages: list[tuple[float, float, int]]
    events: list[tuple[float, int, bool | None, Array]]
    def __init__(
        self,
        equations: Integrable,
        method: Method,
        t0: float,
        y0: ArrayLike,
        t_end: float,
        rtol: float,
        atol: float,
        step: float,
        times: Array,
        *,
        stabilisation: int = 0,
        max_drift: float = ...,
        max_step: float = ...,
        places_only: bool = ...,
        directions: Sequence[int] = (),
        terminal: Sequence[int] = (),
        nodes: Array | None = None,
        counts: ArrayLike = (),
        continues: bool = ...,
    ) -> None: ...
    result: Array
    references: Array
    turns: Array
    sampled: Array
    def called(self, address: int, sizes: Sizes, p: Array) -> Array: ...
    state: Array
    def save(self) -> tuple[bytes, bytes]: ...
    def restore(self, equations: bytes, memory: bytes) -> None: ...
    def take(self, passages: Array, events: Array, states: Array) -> None: ...
    def begin(self) -> int: ...
    def advance(self, most: int) -> int: ...
    def step(self, h: float) -> int: ...
    def extend(self, t_end: float) -> None: ...
    def restart(self, moves: bool) -> int: ...
    def continue_as(self, other: Run) -> None: ...
    def present(self) -> tuple[Array, Array, Array]: ...
    def outputs(
        self, at: KernelEquations, address: int, numbers: Sizes, turning: Sequence[tuple[int, int]]
    ) -> Array: ...
    def advance_noting(self, t: Array, y: Array, references: Array) -> tuple[int, int]: ...
