"""Sweeps, tolerances and optimisation as methods of models."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from symgen.calls import checked

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.sweeps.optimisation import Optimum


class Sweeps:
    """Sweeps of tunable parameters, effects of their tolerances, and their optimum, for every model."""

    @checked
    def sweep(
        self,
        vary: Mapping[str, Any],
        analysis: str | None = None,
        *,
        sampling: str | None = None,
        count: int | None = None,
        seed: int = 0,
        outputs: Sequence[str] | None = None,
        reduce: str | Sequence[str] = "peak",
        file: str | os.PathLike[str] | None = None,
        chunk: int | None = None,
        part: Sequence[int] = (1, 1),
        threads: int | None = None,
        executor: Any = None,
        progress: Callable[[float], None] | None = None,
        **arguments: Any,
    ) -> xarray.Dataset:
        """Carry out an analysis over a design of parameters: see ``docs/sweeps.md``.

        Parameters
        ----------
        vary
            Tunable parameters by name: values in SI units, or a distribution, ``Uniform(low, high)`` or
            ``Normal(mean, deviation)``.
        analysis
            ``simulate``, ``kinematics``, ``inverse_dynamics``, ``equilibrium``, ``modes``, ``periodic`` or
            ``quasi_static``; inverse dynamics when absent, where a model supports it, else the simulation.
        sampling
            ``grid`` (every combination, those of the last parameter change fastest) or ``list`` (one
            value per run) of values; ``sobol``, ``latin-hypercube`` or ``random`` of distributions.
        count, seed
            Number of samples of distributions, and the seed of their random numbers.
        outputs
            Names of the outputs to keep; all when absent.
        reduce
            Names of reductions: see :class:`.ManyRuns`.
        file
            A Zarr store, a name that ends in ``.zarr``. It is written chunk by chunk and can be read at any
            time; where it is there, the sweep continues with the missing chunks. Or a table, ``.csv``, which
            is written at the end. In memory when absent.
        chunk
            Runs of a chunk of a new store; by default 1/64 of all runs, but 64 to 1024.
        part
            ``(i, n)``: carry out every n-th chunk from the i-th, counted from 1.
        threads
            Number of threads; as many as processors when absent, one of each process of an executor. It
            changes no bit of the results.
        executor
            What carries out the chunks in other processes, with the same bits: a number of processes, any
            ``concurrent.futures.Executor``, or a ``distributed.Client`` of Dask.
        progress
            Called now and then with the completed part.
        arguments
            Further arguments of the analysis, common to all runs.

        Returns
        -------
        xarray.Dataset
            ``OUTPUT.REDUCTION`` over the dimension ``run``, histories over ``run`` and ``sample``; parameters
            are coordinates. ``error`` is the message of a failed run, whose outputs are nan.

        Raises
        ------
        ModelError, CapabilityError
            For values, names and arguments that do not fit the model.
        ResultError
            When the store cannot be written, or has the results of another sweep.
        SimulationError, InitialStateError, RangeError
            When none of the first runs succeeds: the error of the first; when processes end without results.
        """
        from symgen.errors import ModelError
        from symgen.runtime.sweeps.designs import design_of
        from symgen.runtime.sweeps.sweep import carry_out, sweep_of

        if len(part) != 2:
            raise ModelError(f"expected part as two numbers (i, n), got {tuple(part)!r}")
        design = design_of(vary, sampling, count, seed)
        sweep = sweep_of(self, analysis, design, outputs, reduce, arguments, threads)
        return carry_out(sweep, file, chunk, (part[0], part[1]), progress, executor)

    @checked
    def tolerances(
        self,
        vary: Mapping[str, Any],
        analysis: str | None = None,
        *,
        method: str = "monte-carlo",
        count: int = 1024,
        seed: int = 0,
        outputs: Sequence[str] | None = None,
        reduce: str | Sequence[str] = "peak",
        threads: int | None = None,
        progress: Callable[[float], None] | None = None,
        **arguments: Any,
    ) -> xarray.Dataset:
        """Return the effect of uncertain parameters on outputs: see ``docs/sweeps.md``.

        Parameters
        ----------
        vary
            Distributions of tunable parameters, as for :meth:`sweep`.
        method
            ``worst-case``: all combinations of the bounds, three standard deviations of normal
            distributions; ``monte-carlo``: statistics of random samples; ``sobol``: shares of the variance by
            parameter, from Saltelli's samples (Saltelli et al., Comput. Phys. Commun. 181, 2010).
        count, seed
            Samples, and the seed of the random numbers. Sobol indices take ``count * (parameters + 2)`` runs;
            the count is a power of two.
        analysis, outputs, reduce, threads, progress, arguments
            As for :meth:`sweep`.

        Returns
        -------
        xarray.Dataset
            Over ``output``, such as ``theta1.drive.peak``, with its ``unit``, and ``parameter``. Worst case:
            ``least``, ``greatest`` and the corners ``least_at``, ``greatest_at``. Monte Carlo: ``mean``,
            ``deviation``, ``error`` of the mean, ``least``, ``greatest``, ``quantile``. Sobol indices:
            ``first`` and ``total``, each with half of its 95 % interval (``first_error``, ``total_error``);
            nan for outputs that do not vary.

        Raises
        ------
        ModelError, CapabilityError
            As :meth:`sweep`; when a parameter has no distribution.
        SimulationError
            When a run fails: statistics of the others would be biased.
        """
        from symgen.runtime.sweeps.tolerances import tolerances_of

        return tolerances_of(
            self, vary, analysis, method, count, seed, outputs, reduce, threads, progress, arguments
        )

    @checked
    def optimise(
        self,
        variables: Mapping[str, Any],
        objective: str,
        constraints: Mapping[str, Any] | None = None,
        analysis: str | None = None,
        *,
        method: str = "SLSQP",
        start: Mapping[str, float] | None = None,
        tolerance: float = 1e-8,
        iterations: int = 200,
        seed: int = 0,
        threads: int | None = None,
        **arguments: Any,
    ) -> Optimum:
        """Return the values of tunable parameters that minimise an output: see ``docs/sweeps.md``.

        A least peak, or a bound on one, is a bound on every sample: a smooth problem. Gradients are exact, by
        :meth:`sensitivity`, where it has the outputs; else differences, and ``gradients`` says why.

        Parameters
        ----------
        variables
            Lower and upper bound of each parameter, in SI units.
        objective
            The quantity to minimise: ``OUTPUT.REDUCTION`` as of :meth:`sweep`, such as ``crank.torque.peak``,
            with a component where it has several, such as ``C.position.range.x``; or one of the variables.
        constraints
            Lower and upper bound of further quantities, None for one without.
        analysis, threads, arguments
            As for :meth:`sweep`.
        method
            ``SLSQP`` or ``trust-constr`` from a start, to a local minimum; ``differential-evolution`` over
            the whole range, with one call for all runs of a generation.
        start
            Values to start from; those of the model, within the bounds, when absent, or if their run fails
            the nearest of some others whose run succeeds.
        tolerance, iterations, seed
            Tolerance and most iterations of the method; seed of differential evolution.

        Raises
        ------
        ModelError, CapabilityError
            For names, bounds and arguments that do not fit the model.
        SimulationError, InitialStateError, RangeError
            When the run of a given start fails, or those of all points that are tried; later, steps to such
            points are shortened, and differential evolution takes them as infeasible.
        """
        from symgen.runtime.sweeps.optimisation import optimum_of
        from symgen.runtime.sweeps.problem import OptimisationArguments

        limits, shared = constraints or {}, (tolerance, iterations, threads, arguments)
        return optimum_of(
            OptimisationArguments(self, variables, limits, analysis, start or {}, *shared, method, seed),
            objective,
        )

    @checked
    def pareto(
        self,
        variables: Mapping[str, Any],
        objectives: Sequence[str],
        constraints: Mapping[str, Any] | None = None,
        analysis: str | None = None,
        *,
        points: int = 9,
        start: Mapping[str, float] | None = None,
        tolerance: float = 1e-8,
        iterations: int = 200,
        threads: int | None = None,
        **arguments: Any,
    ) -> xarray.Dataset:
        """Return designs of which none is better in both of two objectives: see ``docs/sweeps.md``.

        The first objective is minimised by SLSQP under bounds on the second (epsilon constraints), which rise
        in equal steps from its own minimum to its value where the first is least. Minima are local.

        Parameters
        ----------
        objectives
            Two quantities to minimise, or a quantity and a variable.
        points
            Number of bounds. Designs that another one dominates are omitted.
        variables, constraints, analysis, start, tolerance, iterations, threads, arguments
            As for :meth:`optimise`.

        Returns
        -------
        xarray.Dataset
            Over ``point``: both objectives, ``converged``, and the variables as coordinates, in SI units.

        Raises
        ------
        ModelError, CapabilityError, SimulationError, InitialStateError, RangeError
            As :meth:`optimise`.
        """
        from symgen.runtime.sweeps.pareto import front_of
        from symgen.runtime.sweeps.problem import OptimisationArguments

        limits, shared = constraints or {}, (tolerance, iterations, threads, arguments)
        return front_of(
            OptimisationArguments(self, variables, limits, analysis, start or {}, *shared), objectives, points
        )


for _call in (
    Sweeps.sweep,
    Sweeps.tolerances,
    Sweeps.optimise,
    Sweeps.pareto,
):  # messages name the model, not the mixin
    _call.__wrapped__.__qualname__ = f"Model.{_call.__name__}"  # type: ignore[union-attr]
