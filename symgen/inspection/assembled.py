"""Assembled matrices of the elastic motion as numbers, in the pose of a crank angle or at a time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeGuard

from symgen.errors import ModelError
from symgen.inspection.values import of_drive
from symgen.pipeline.build import build_scene
from symgen.report.mathematics.numbers import table_of_numbers

if TYPE_CHECKING:
    from symgen.pipeline.subject import Subject

_ENDINGS = ("mass", "damping", "stiffness", "load")
#: Matrices of the elastic motion that are assembled for a scene with elastic links in the plane.
NAMES = (
    *(f"elastic_{name}" for name in (*_ENDINGS, "gyroscopic", "geometric_stiffness", "motion_stiffness")),
    "assembly",
    "boundary",
    *("condensation", "condensation_rate", "condensation_second_rate"),
    *(f"condensed_{name}" for name in _ENDINGS),
)


def numbers(subject: Subject, name: str, at: str | None, rows: str | None, columns: str | None) -> str:
    """Return a matrix, or selected rows and columns of it, as runs assemble it.

    ``at`` is an angle of the crank or a time as text; the start if None.

    Raises
    ------
    ModelError
        For other text, and names that there are not.
    """
    model: Any = build_scene(subject.text)
    value, label = None, "at the start"
    if at:
        (value, *_), over = of_drive(model, [at], "--at")
        label = f"at t = {value:g} s" if over == "time" else f"at {math.degrees(value):g} deg"
    found = model.matrices() if value is None else model.matrices(value, over=over)
    matrix = found[name].part(*(_listed(text) for text in (rows, columns)))
    return table_of_numbers(
        f"{name} {label}: {matrix.about} [{matrix.unit}]",
        [f"{row} [{unit}]" for row, unit in zip(matrix.rows, matrix.row_units, strict=True)],
        matrix.columns,
        matrix.values.reshape(len(matrix.rows), -1).tolist(),
    )


def _listed(text: str | None) -> list[str]:
    return [part.strip() for part in text.split(",")] if text else []


def is_assembled(name: str | None, subject: Subject) -> TypeGuard[str]:
    """Return whether a name is that of an assembled matrix of a scene with elastic links in the plane."""
    if not subject.is_scene or name not in NAMES:
        return False
    resolved = subject.resolved
    if resolved.method != "elastic":
        raise ModelError(f"{subject.name} has no elastic links in the plane, to which {name} belongs")
    return True
