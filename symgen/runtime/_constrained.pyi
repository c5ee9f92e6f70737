"""Types of systems of elements with constraints; see ``_constrained.pyx`` for what things do."""

from collections.abc import Callable, Mapping, Sequence

from numpy.typing import ArrayLike

from symgen.runtime._core import Integrable
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.elastic.large.collocation import EnvelopePattern
from symgen.runtime.kernels.evaluate import Evaluator

class Part:
    pairs: Indices
    bound: Indices

class Elements(Part):
    def __init__(
        self, kernels: Mapping[str, int], places: Indices, properties: Array, damped: bool
    ) -> None: ...
    def values(self, kernel: str, width: int, q: Array, v: Array, a: Array) -> Array: ...

class Rows(Part):
    def __init__(
        self,
        kernel: int,
        places: Indices,
        slopes: Indices,
        first: int,
        factors: Array,
        properties: Array,
        acting: Array,
        inner: Indices,
        curvature: Array | None,
    ) -> None: ...

class Ties(Part):
    def __init__(self, rows: ArrayLike, places: ArrayLike, factors: ArrayLike) -> None: ...

class Rigid(Part):
    def __init__(
        self,
        rigid: Evaluator,
        joints: Evaluator,
        rows: Sequence[int],
        in_jacobian: Sequence[int],
        sizes: ArrayLike,
        entries: Sequence[Indices | Sequence[tuple[int, ...]]],
    ) -> None: ...
    def take_parameters(self, joints: ArrayLike) -> None: ...

class Added(Part):
    def __init__(
        self,
        forces: Callable[[Array, Array, Array, Array], Array],
        slopes: Callable[[Array, Array, Array], Array],
        places: Indices,
        power: Callable[[], Array],
    ) -> None: ...

class Constrained:
    def __init__(
        self, unknowns: int, multipliers: int, known: int, pattern: EnvelopePattern, parts: Sequence[Part]
    ) -> None: ...
    def forces(self, *state: Array) -> Array: ...
    def rows(self, t: Array, q: Array, v: Array, known: Array, known_rates: Array) -> tuple[Array, Array]: ...
    def slopes(self, *state: Array) -> tuple[Array, Array, Array, Array]: ...
    def accelerated(self, right: Array, *state: Array) -> Array: ...

class SystemMotion(Integrable):
    def __init__(
        self,
        system: Constrained,
        scale: Array,
        stages: int,
        prescribed: Callable[[int], tuple[int, Array, Array]],
        follow: Callable[[float, Array, Array], None] | None,
        a: Array,
        multipliers: Array,
        rigid: Evaluator | None,
    ) -> None: ...
    @property
    def of_stages(self) -> tuple[Array, Array]: ...
