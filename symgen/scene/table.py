"""Common parts of all tables of a scene: strict tables, names, values, texts."""

from __future__ import annotations

import re
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    StringConstraints,
    model_validator,
)
from pydantic_core import CoreSchema

from symgen.errors import CONTROL, SceneError, shown

_NAME, _LONGEST = r"^[A-Za-z][A-Za-z0-9_]*$", 40
Name = Annotated[str, StringConstraints(pattern=_NAME, max_length=_LONGEST)]
Value = Annotated[
    str | int | float,
    Field(description='A quantity ("2 cm"), an expression over parameters ("2*a"), or a plain number.'),
]
Vector = Annotated[list[Value], Field(min_length=2, max_length=3)]
SpatialVector = Annotated[list[Value], Field(min_length=3, max_length=3)]
Moments = Annotated[list[Value], Field(min_length=3, max_length=6)]


#: Words for people.
Text = Annotated[str, StringConstraints(pattern=f"^[^{CONTROL}]*$")]


def checked_name(name: str) -> str:
    """Return the name of a scene; raise SceneError if functions in C cannot begin with it."""
    if not re.fullmatch(_NAME, name) or name.endswith("\n") or len(name) > _LONGEST:
        raise SceneError(
            f"expected a name of letters, digits and underscores, a letter first, got {shown(name)}",
            where="name",
            hint=f"It has at most {_LONGEST} characters, and begins the names of functions in C.",
        )
    return name


def absent(description: str) -> Any:
    """Return the field of a key that may be absent."""
    return Field(None, description=description)


class Table(BaseModel):
    """A table of the scene: unknown keys are errors, and nothing changes after it was read."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=True)


class Bare(Table):
    """A table for which the bare value of its key ``BARE``, of one of the types ``OF``, may stand."""

    BARE: ClassVar[str]
    OF: ClassVar[tuple[type, ...]] = (str, int, float)

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, data: Any) -> Any:
        return {cls.BARE: data} if isinstance(data, cls.OF) else data

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Tell editors that the bare value may stand for the table."""
        table = handler(core)
        return {"anyOf": [table, handler.resolve_ref_schema(table)["properties"][cls.BARE]]}
