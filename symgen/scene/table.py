"""Common parts of all tables of a scene: strict tables, names, values, texts."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=40)]
Value = Annotated[
    str | int | float,
    Field(description='A quantity ("2 cm"), an expression over parameters ("2*a"), or a plain number.'),
]
Vector = Annotated[list[Value], Field(min_length=2, max_length=3)]
SpatialVector = Annotated[list[Value], Field(min_length=3, max_length=3)]
Moments = Annotated[list[Value], Field(min_length=3, max_length=6)]


#: Words for people: any characters but control characters, which have no place in generated comments.
Text = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]


class Table(BaseModel):
    """A table of the scene: unknown keys are errors, and nothing changes after it was read."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=True)
