"""User-defined ``studies`` of a scene: varied parameters, plots and limits."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from symgen.scene.table import Name, Table, Text, Value

Values = Annotated[list[Value], Field(min_length=1)]


class Limit(Table):
    """The value of a parameter up to which the loop can be driven through its whole range."""

    parameter: Name
    start: Value = Field(description="A value at which it can; the search goes from here ...")
    stop: Value = Field(description="... to here, up or down.")


class Study(Table):
    """A driven loop over its range, for every combination of some values of its tunable parameters."""

    name: Name
    about: Text = Field("", description="Heading of its plots and tables.")
    vary: dict[Name, Values] = Field(default_factory=dict, description="Values of tunable parameters.")
    set: dict[str, Value] = Field(
        default_factory=dict,
        description="Other changes to the scene, by parameter or dotted key, as with --set.",
    )
    plots: list[str] = Field(default_factory=list, description="Outputs to draw over the input.")
    limits: list[Limit] = Field(default_factory=list)
