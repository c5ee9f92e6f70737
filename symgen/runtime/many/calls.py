"""Many runs of one model in a call: the analyses, and their arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MethodType
from typing import TYPE_CHECKING, Any, Protocol, cast

from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import CapabilityError

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.many.dataset import CompiledRuns
    from symgen.runtime.many.runs import Runs
    from symgen.runtime.result.state import State


class ManyCall(Protocol):
    """Signature of ``model.simulate_many`` and the other calls for many runs."""

    def __call__(
        self,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        states: Sequence[State] | None = None,
        outputs: Sequence[str] | None = None,
        reduce: Callable[..., Any] | str | Sequence[str] | None = None,
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
        **arguments: Any,
    ) -> xarray.Dataset:
        """See :class:`.ManyRuns`."""


class Many:
    """The analysis NAME of many variants: ``model.NAME_many``, where the model supports NAME."""

    def __init__(self, analysis: str) -> None:
        self.analysis = analysis

        def call(
            model: Any,
            parameters: Mapping[str, ArrayLike] | None = None,
            *,
            states: Any = None,
            outputs: Sequence[str] | None = None,
            reduce: Callable[..., Any] | str | Sequence[str] | None = None,
            threads: int | None = None,
            progress: Callable[[float], None] | None = None,
            **arguments: Any,
        ) -> xarray.Dataset:
            from symgen.runtime.many.dataset import Keep, dataset_of
            from symgen.runtime.many.runs import Runs, carried_out, variants

            runs = Runs(model, analysis, *variants(model, parameters or {}, states), arguments)
            found = carried_out(runs, Keep(outputs, reduce), threads, progress)
            return dataset_of(model.description, analysis, runs.columns, *found)

        call.__name__ = f"{analysis}_many"
        call.__qualname__ = f"Model.{analysis}_many"
        call.__doc__ = f"Carry out {analysis} for many variants: see :class:`.ManyRuns`."
        self.call = checked(call)

    def __get__(self, model: Any, owner: type | None = None) -> ManyCall:
        """Return the bound call; raise CapabilityError where the model does not support the analysis."""
        if model is None:
            return cast("ManyCall", self.call)
        reason = model._refused(self.analysis)
        if reason is not None:
            raise CapabilityError(f"{model.name} does not support {self.analysis}_many: {reason}")
        return MethodType(self.call, model)


class ManyRuns:
    """Analyses of many variants of a model in one call, in several threads.

    Every call takes the arguments of its analysis, which are common to all runs, and those below.

    Parameters
    ----------
    parameters
        Values of tunable parameters by name, in SI units: one number for all runs, or one per run.
    states
        Initial states, one per run; by default those of the variants.
    outputs
        Names of the outputs to keep; by default all.
    reduce
        Function that is called as ``reduce(values, axis=0)`` with the samples of each output, such as
        ``np.max``; its results replace the samples. Or names of reductions, each of which gives
        an output ``OUTPUT.NAME``: ``peak`` (largest magnitude of the output or vector), ``greatest``,
        ``least``, ``range``, ``mean``, ``rms`` (of the magnitude), ``final``; ``history`` keeps the samples.
    threads
        Number of threads; by default that of processors. It changes no bit of the results.
    progress
        Called from time to time with the completed part of all runs, 0 to 1.

    Returns
    -------
    xarray.Dataset
        Outputs over the dimension ``run`` and the coordinate of the analysis, with the parameters as
        coordinates of the runs and the largest drift of each run where it is measured. ``error`` is the
        message of a run that failed, and empty for all others. ``ended_early``, of runs that dead centres or
        events may end, is the reason, and empty where the run covered its range. Outputs of a failed run are
        nan, as are samples that a run did not reach. If runs differ in the values of their coordinate, the
        dimension is ``sample``, and the coordinate has a row per run. Every run has the bits of a single
        analysis of ``model.with_parameters(...)``. The attribute ``notes`` is the reason for which runs of
        ``simulate`` are not in SIMD lanes, and absent where they are.

    Raises
    ------
    ModelError
        For parameters, states and outputs of wrong names or shapes, and arguments that the analysis refuses.
    SimulationError, InitialStateError, RangeError
        When no run succeeds: the error of the first.
    """

    simulate_many = Many("simulate")
    kinematics_many = Many("kinematics")
    inverse_dynamics_many = Many("inverse_dynamics")
    equilibrium_many = Many("equilibrium")
    modes_many = Many("modes")
    periodic_many = Many("periodic")
    quasi_static_many = Many("quasi_static")

    def _compiled_runs(self, runs: Runs, first: Any) -> CompiledRuns | str:
        """Return runs with the options of a first one, or a reason, maybe '', to carry out each singly."""
        return ""

    def _driven_runs(self, runs: Runs) -> CompiledRuns | None:
        """Return runs of kinematics, or of inverse dynamics; None where each is to be carried out singly."""
        return None


#: The calls of many runs by name, and the analysis of each.
MANY = {name: value.analysis for name, value in vars(ManyRuns).items() if isinstance(value, Many)}
