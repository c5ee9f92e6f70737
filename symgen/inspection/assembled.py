"""Assembled matrices of the elastic motion as numbers, in the pose of a crank angle or at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeGuard

from symgen.errors import ModelError
from symgen.inspection.values import crank_or_time
from symgen.mechanics.sources import of_assembly
from symgen.models.assembled.condensed import REDUCED
from symgen.models.assembled.system import ASSEMBLED
from symgen.pipeline.build import build_scene
from symgen.report.mathematics.equations import used_terms
from symgen.report.mathematics.numbers import substituted, table_of_numbers
from symgen.runtime.elastic.large.matrices import LARGE
from symgen.runtime.elastic.matrices import CONDENSED
from symgen.symbolic.system import NO_SOURCE

if TYPE_CHECKING:
    import sympy as sp

    from symgen.pipeline.subject import Chosen, Subject

#: Beyond this, an entry of R makes half of the digits of a pose those of its rounding errors.
_LARGE = 1e8


def numbers(subject: Subject, name: str, at: str | None, rows: str | None, columns: str | None) -> str:
    """Return a matrix, or selected rows and columns of it, as runs assemble it.

    ``at`` is an angle of the crank or a time as text; the start if None.

    Raises
    ------
    ModelError
        For other text, and names that there are not.
    """
    model: Any = build_scene(subject.text)
    value, over, label = crank_or_time(at) if at else (None, "input", "at the start")
    found = model.matrices(value, over=over, elements=model._elements if name in LARGE else None)
    matrix = found[name].part(*(_listed(text) for text in (rows, columns)))
    return table_of_numbers(
        f"{name} {label}: {matrix.about} [{matrix.unit}]",
        [f"{row} [{unit}]" if unit else row for row, unit in zip(matrix.rows, matrix.row_units, strict=True)],
        matrix.columns,
        matrix.values.reshape(len(matrix.rows), -1).tolist(),
    )


def check_independent(chosen: Chosen, values: Mapping[str, float | sp.Expr], label: str) -> None:
    """Check that the unknowns that are independent in the drawn pose determine the others in a pose.

    Raises
    ------
    ModelError
        Where they do not, and the matrices depend on R; ``label`` names the pose.
    """
    system = chosen.system
    if "condensation" not in system:
        return
    basis = system["condensation"]
    if not basis.matrix.free_symbols & used_terms(system, chosen.matrices).keys():
        return
    numbers = substituted(system, basis, values)
    for unknown, column in zip(basis.columns, numbers.T.tolist(), strict=True):
        if not all(x.free_symbols or (x.is_finite and abs(x) < _LARGE) for x in column):
            raise ModelError(
                f"{unknown}, independent in the drawn pose, does not determine the motion {label}, "
                f"where {chosen.matrices[0].name} has no value\n"
                "  condensed_mass and so on take the independent unknowns of each pose; or "
                "draw the linkage in another one."
            )


def _listed(text: str | None) -> list[str]:
    return [part.strip() for part in text.split(",")] if text else []


def is_assembled(
    name: str | None, subject: Subject, *, numeric: bool, symbolic: Sequence[str] = ()
) -> TypeGuard[str]:
    """Return whether a name is that of an assembled matrix that is shown as numbers.

    Raises
    ------
    ModelError
        For such a name of a scene without elastic links in the plane, and for options that apply to symbolic
        matrices, ``symbolic``, next to a name of numbers alone.
    """
    if not subject.is_scene or name not in (*ASSEMBLED, *CONDENSED, *LARGE):
        return False
    if not subject.is_assembled:
        raise ModelError(f"{subject.name} has no elastic links in the plane, to which {name} belongs")
    if symbolic and name not in ASSEMBLED:
        raise ModelError(f"{name} is a matrix of numbers alone, shown without {' and '.join(symbolic)}")
    return (numeric or name not in ASSEMBLED) and not symbolic


def assembled_names(subject: Subject) -> list[tuple[str, ...]]:
    """Return name, unit, meaning and source of the assembled matrices of a scene, if any."""
    if not subject.is_assembled:
        return []
    bound = subject.constraints
    sources = dict(of_assembly(bound))
    return [
        (name, *about, sources.get(name, NO_SOURCE))
        for name, about in (ASSEMBLED | REDUCED | CONDENSED | LARGE).items()
        if bound or not ("condensation" in name or name in REDUCED | CONDENSED)
    ]
