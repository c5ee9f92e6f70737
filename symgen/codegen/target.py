"""What code is generated for: one row a precision, one row a backend."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Precision:
    """A floating-point type: its C name, bytes, and the suffixes of its literals and math functions."""

    name: str
    c_type: str
    size: int
    literal_suffix: str
    function_suffix: str


PRECISIONS = {"float64": Precision("float64", "double", 8, "", "")}


@dataclass(frozen=True, slots=True)
class Target:
    """Precision and language of the generated code."""

    language: str = "c"
    precision: Precision = PRECISIONS["float64"]
