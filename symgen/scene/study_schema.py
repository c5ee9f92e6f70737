"""The tables ``sweep`` and ``optimise`` of a scene."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from symgen.scene.table import Table, Value, absent

Values = Annotated[list[Value], Field(min_length=1)]


_ANALYSIS = (
    "Analysis of each run, such as simulate; by default simulate for elastic links, else inverse_dynamics."
)


class SweepTable(Table):
    """A sweep of parameters, which ``symgen sweep`` carries out."""

    vary: dict[str, Value | Values] = Field(
        description="By parameter or dotted key: START:STOP:COUNT, a list of values, LOW:HIGH to sample, or "
        "normal(MEAN, DEVIATION)."
    )
    sampling: Literal["grid", "list", "sobol", "latin-hypercube", "random"] | None = None
    count: int | None = absent("Number of samples of ranges and distributions.")
    seed: int = 0
    analysis: str | None = absent(_ANALYSIS)
    outputs: list[str] | None = absent("Outputs to keep; all if absent.")
    reduce: list[str] = Field(["peak"], description="Reductions of the outputs of a run, or history.")
    samples: int | None = absent("Number of samples of a run.")
    t_end: float | None = absent("End of simulated runs [s].")
    chunk: int | None = absent("Runs that are written at a time.")


class BoundsTable(Table):
    """Bounds of an output; numbers are in SI units."""

    least: Value | None = None
    greatest: Value | None = None


class Optimise(Table):
    """An optimisation of parameters, which ``symgen optimise`` carries out."""

    variables: dict[str, Annotated[list[Value], Field(min_length=2, max_length=2)]] = Field(
        description="Lower and upper bound by parameter or dotted key."
    )
    objective: str | Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="The quantity to minimise, such as crank.torque.peak, or two for a Pareto front."
    )
    points: int | None = absent("Number of points of a Pareto front (9).")
    constraints: dict[str, BoundsTable] = Field(
        default_factory=dict, description="Bounds of further quantities."
    )
    analysis: str | None = absent(_ANALYSIS)
    method: Literal["SLSQP", "trust-constr", "differential-evolution"] = "SLSQP"
    seed: int = 0
    samples: int | None = absent("Number of samples of a run.")
    t_end: float | None = absent("End of simulated runs [s].")
