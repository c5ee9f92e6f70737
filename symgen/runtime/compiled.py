"""What every compiled model has, linkage or loop: its name, its kernels, its equations, its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symgen.errors import ModelError, nearest
from symgen.precision import FLOAT64, Precision
from symgen.runtime.arguments import real
from symgen.runtime.description import Described
from symgen.runtime.library import Library
from symgen.runtime.typed import Typed

if TYPE_CHECKING:
    from symgen.runtime.batch import Batch, Rows


class Compiled:
    """Kernels of one scene with values of its tunable parameters."""

    description: Described

    def __init__(
        self,
        description: Described,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None,
        typed: Typed | None,
    ) -> None:
        self._typed = typed
        self._batch: Batch | None = None
        self.description, self._library, self._derive = description, library, derive
        self.parameters: dict[str, float] = {p.name: p.default for p in description.parameters}
        for name, value in (parameters or {}).items():
            if name not in self.parameters:
                raise ModelError(
                    f"{description.name} has no tunable parameter {name!r}. {nearest(name, self.parameters)}"
                )
            self.parameters[name] = real(value, f"{name}, in SI units")
        self._equations: Any = None

    def _repr_html_(self) -> str:
        from symgen.report.notebook import model_html

        return model_html(self)

    @property
    def name(self) -> str:
        """Short name of the scene."""
        return self.description.name

    @property
    def backend(self) -> str:
        """Where the kernels come from: ``c`` (compiled for the scene), ``shipped``, ``numpy``, ``mpmath``."""
        return "mpmath" if self._typed and self._typed.digits else self._library.backend

    @property
    def precision(self) -> str:
        """The type that runs and batches are computed in: ``float64``, or as it was built."""
        return self._type.name

    @property
    def typed(self) -> Typed | None:
        """Kernels in the type of runs, where that is not float64."""
        return None if self._typed is None or self._typed.is_plain else self._typed

    @property
    def _type(self) -> Precision:
        return self._typed.precision if self._typed else FLOAT64

    def _in_type(self, t: float, q: Any, u: Any, solution: Any) -> Any:
        """Return accelerations and multipliers in the model's own type, where that is not float64."""
        if self.typed is None:
            return solution
        found = self.batch("accelerations", t, q[None], u[None])
        return [*found["accelerations"][0], *found["multipliers"][0]]

    @property
    def equations(self) -> Any:
        """The derived SymPy matrices by name: ``model.equations["mass_matrix"]``."""
        if self._equations is None:
            self._equations = self._derive()
        return self._equations

    @property
    def operations(self) -> dict[str, dict[str, int]]:
        """Operations of each kernel by kind."""
        return {k.name: dict(k.operations) for k in self.description.kernels}

    @property
    def is_changed(self) -> bool:
        """Whether a parameter has another value than in the scene."""
        return any(self.parameters[p.name] != p.default for p in self.description.parameters)

    def batch(
        self,
        what: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        *,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> dict[str, Rows]:
        """Evaluate a kernel at many states in one call, in the precision the model was built in.

        States go side by side through the lanes of vector registers. Each gets the operations of the kernel
        and no others: multipliers are not refined, and where constraints are redundant they are one choice
        of many.

        Parameters
        ----------
        what
            A kernel of :attr:`operations`, or one of its results, such as ``"accelerations"``.
        t
            One time [s], or one a state.
        q, u
            A row a state: coordinates and velocities, as in ``State.q`` and ``State.u``; zero velocities
            when absent.
        work
            A row a state of what the kernel finds in its work memory; the accelerations and multipliers of
            the state when absent.
        threads
            Into how many threads the states are parted. It changes no bit of the results.

        Returns
        -------
        dict
            Results of the kernel by name, a row a state: in the model's precision where NumPy has it
            (``float32``, ``float64``, ``longdouble``), in float64 for ``float128``, and mpmath's numbers for
            the backend ``mpmath``.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other shapes.
        """
        return self._evaluate_many(what, t, q, u, work, threads)[0]

    def _refuse_types(self, what: str, but: str = "") -> None:
        """Refuse what is computed in doubles only, where another type was asked for; ``but`` those of C."""
        if self.typed and (self.typed.digits or not but):
            how = f"{self.typed.digits} digits" if self.typed.digits else self.precision
            raise ModelError(
                f"{what} computed in {but or 'float64'} only, and {self.name} was built for {how}\n"
                f"  model.batch() evaluates its kernels in {how}."
            )

    def _evaluate_many(
        self,
        what: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> tuple[dict[str, Rows], dict[str, Rows]]:
        """Return what :meth:`batch` does, and beside it what float64 leaves of float128."""
        if self._batch is None:
            if self._typed is None:
                raise ModelError(f"{self.name} has no kernels for batches: build it with symgen.build")
            from symgen.runtime.batch import Batch

            self._batch = Batch(self.description, self._typed, self.parameters)
        return self._batch(what, t, q, u, work, threads)
