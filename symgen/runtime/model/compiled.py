"""Kernels, equations and parameters of a compiled model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.display import display
from symgen.errors import ModelError, RangeError, check_tunable
from symgen.precision import FLOAT64, Precision
from symgen.runtime.integrate.options import SERIES_RTOL, SERIES_RTOL_PROBED
from symgen.runtime.kernels.arguments import real
from symgen.runtime.kernels.description import Described
from symgen.runtime.kernels.library import SERIES, Library
from symgen.runtime.kernels.limits import refusals
from symgen.runtime.kernels.typed import Typed, library_of_runs

if TYPE_CHECKING:
    from symgen.runtime.kernels.batch import Batch, Rows


#: Returns the kernels of one kind of analysis of some outputs, built on first use.
Analyses = Callable[..., tuple[Any, Library]]


class Parameters(Mapping[str, float]):
    """Values of tunable parameters by name, which cannot be changed: analyses depend on them."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return repr(self._values)

    def _refused(self, *_: Any, **__: Any) -> NoReturn:
        raise ModelError(
            "the parameters of a model cannot be changed in place\n"
            "  model.with_parameters(NAME=value) returns the model with another value, without compiling."
        )

    __setitem__ = __delitem__ = update = setdefault = pop = popitem = clear = __ior__ = _refused


@checked
class Compiled:
    """Kernels of one scene with values of its tunable parameters."""

    description: Described
    #: Whether an event or a jump of a load has no power series.
    _probed = False

    def __init__(
        self,
        description: Described,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None = None,
        analyses: Analyses | None = None,
        typed: Typed | None = None,
    ) -> None:
        self._analyses = analyses
        #: Kernels in the number type of the model, single and in lanes.
        self.number_type = typed
        self._batches: Batch | None = None
        #: Kernels of one state, in doubles.
        self.library = library
        self.description, self._derive = description, derive
        values = {p.name: p.default for p in description.tunable}
        for name, value in (parameters or {}).items():
            check_tunable(name, values, description.name)
            values[name] = real(value, f"{name}, in SI units")
        self._parameters = Parameters(values)
        self._equations: Any = None
        #: Names of analyses that are known to be supported.
        self._supported = set[str]()

    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model with other values of its tunable parameters, in SI units.

        Raises
        ------
        ModelError
            For an unknown name and a value that is not finite.
        RangeError
            When a value of the scene, such as a mass, has the wrong sign at these parameters.
        """
        changed = {**self.parameters, **values}
        parts = self.description, self.library, self._derive, changed, self._analyses, self.number_type
        model = type(self)(*parts, **self._more)
        row = np.array([[*model.parameters.values()]])
        for reason in refusals(self.description, self.library, row).values():
            raise RangeError(f"{self.name}: {reason}")
        return model

    @property
    def _more(self) -> dict[str, Any]:
        """Further arguments of the class."""
        return {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the scene, the options and the parameters; the kernels are reopened from the cache."""
        return self.source.restored, (dict(self.parameters),)

    @property
    def source(self) -> Any:
        """Scene and options of the build; raise ModelError for a model that was created without its scene."""
        if not hasattr(self._derive, "restored"):
            raise ModelError(
                f"{self.name} was created without its scene: it can be neither pickled nor drawn"
            )
        return self._derive

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values of the tunable parameters, in SI units, read-only: :meth:`with_parameters` changes them."""
        return self._parameters

    @checked
    def widget(
        self, vary: Mapping[str, Any], analysis: str | None = None, *, frames: int = 121, **arguments: Any
    ) -> Any:
        """Return a notebook widget: a slider for each parameter, the moving picture and curves of the run.

        A slider that is let go carries the analysis out anew with the values of all sliders. Where that
        fails, the widget shows the message above the last picture.

        Parameters
        ----------
        vary
            Tunable parameters by name, each with its range in SI units: ``(low, high)`` or ``Uniform``.
        analysis
            ``simulate``, ``kinematics`` or ``inverse_dynamics``; that of sweeps when absent.
        frames
            Number of frames of the picture, at most.
        arguments
            Further arguments of the analysis.

        Returns
        -------
        anywidget.AnyWidget
            ``values`` holds the parameters by name; assigning to it moves the sliders.

        Raises
        ------
        ModelError
            Without anywidget, and for a name or a range that does not fit.
        SymgenError
            As of the analysis with the present values.
        """
        return display("widget", self, vary, analysis, frames, arguments)

    def _repr_html_(self) -> str:
        return display("model_html", self)

    @property
    def name(self) -> str:
        """Short name of the scene."""
        return self.description.name

    @property
    def method(self) -> str:
        """Name of the method of the model, a row of ``symgen.methods``."""
        return self.description.method

    @property
    def backend(self) -> str:
        """Where the kernels come from: ``c`` (compiled for the scene), ``shipped``, ``numpy``, ``mpmath``."""
        return "mpmath" if self.number_type and self.number_type.digits else self.library.backend

    @property
    def mobility(self) -> tuple[str, ...]:
        """Degrees of freedom at the start, and redundant constraints, as one line of text each."""
        return (self.description.extent,)

    @property
    def precision(self) -> str:
        """Number type of runs and batches, ``float64`` by default."""
        return self._type.name

    @property
    def typed(self) -> Typed | None:
        """Kernels in the type of runs; None if that is float64."""
        return None if self.number_type is None or self.number_type.is_plain else self.number_type

    @property
    def _type(self) -> Precision:
        return self.number_type.precision if self.number_type else FLOAT64

    @cached_property
    def _series(self) -> float:
        """Largest relative tolerance at which its runs take power series by default; 0 without series."""
        if SERIES not in library_of_runs(self.library, self.number_type).addresses:
            return 0.0
        return SERIES_RTOL_PROBED if self._probed else SERIES_RTOL

    def _in_type(self, t: float, q: Any, u: Any, solution: Any) -> Any:
        """Return accelerations and multipliers in the model's own type, if that is not float64."""
        if self.typed is None:
            return solution
        blocks = self._batch("accelerations", t, q[None], u[None])
        return [*blocks["accelerations"][0], *blocks["multipliers"][0]]

    @property
    def equations(self) -> Any:
        """The derived SymPy matrices by name: ``model.equations["mass_matrix"]``."""
        if self._equations is None:
            self._equations = self._derive()
        return self._equations

    @property
    def parameter_values(self) -> list[float]:
        """Parameters in the order of the kernels: :attr:`parameters`, then those held during a step."""
        d = self.description
        return [*self.parameters.values(), *(p.default for p in d.parameters[len(d.tunable) :])]

    @property
    def operations(self) -> dict[str, dict[str, int]]:
        """Operations of each kernel by kind."""
        return {k.name: dict(k.operations) for k in self.description.kernels}

    @property
    def is_changed(self) -> bool:
        """Whether a parameter has another value than in the scene."""
        return any(self.parameters[p.name] != p.default for p in self.description.tunable)

    def _differentiated(self, names: Sequence[str] | None, further: Sequence[str] = ()) -> tuple[str, ...]:
        """Return the tunable parameters, or ``further`` quantities, for differentiation; by default all.

        Raises
        ------
        ModelError
            For an unknown name, and if there are none.
        """
        by = tuple([*self.parameters, *further] if names is None else names)
        for name in by:
            if name not in further:
                check_tunable(name, self.parameters, self.name)
        if not by and self.parameters:
            raise ModelError(
                f"expected parameters of {self.name} to differentiate by, got none\n"
                f"  Leave them out for all: {', '.join(self.parameters)}."
            )
        if not by:
            raise ModelError(
                f"{self.name} has no tunable parameters to differentiate by\n"
                "  Write tunable = true for some under [parameters] of the scene."
            )
        return by

    def _batch(
        self,
        kernel: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> dict[str, Rows]:
        return self._evaluate_many(kernel, t, q, u, work, threads)[0]

    def _refuse_types(self, noun: str, but: str = "") -> None:
        """Raise ModelError if an analysis in doubles does not apply to the type of the model."""
        if self.typed and (self.typed.digits or not but):
            number_type = f"{self.typed.digits} digits" if self.typed.digits else self.precision
            raise ModelError(
                f"{noun} computed in {but or 'float64'} only, and {self.name} was built for {number_type}\n"
                f"  model.batch() evaluates its kernels in {number_type}."
            )

    def _evaluate_many(
        self,
        kernel: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> tuple[dict[str, Rows], dict[str, Rows]]:
        """Return the results of a batch, and the remainders of float128 results beyond float64."""
        if self._batches is None:
            if self.number_type is None:
                raise ModelError(f"{self.name} has no kernels for batches: build it with symgen.build")
            from symgen.runtime.kernels.batch import Batch

            self._batches = Batch(self.description, self.number_type, self.parameter_values)
        return self._batches(kernel, t, q, u, work, threads)


def degrees(count: int) -> str:
    """Return a number of degrees of freedom in words."""
    return "1 degree" if count == 1 else f"{count} degrees"
