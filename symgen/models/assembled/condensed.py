"""Assembled equations of the independent unknowns of inextensible and rigid links, in letters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.elements.element import entry_unit
from symgen.mechanics.elastic.letters import CONDENSING, FREE, WHOLE, reduced, reduced_vibration
from symgen.mechanics.rods.condensation import BASIS, allowed_motions
from symgen.mechanics.sources import THESIS_LINKS, named_condensation
from symgen.symbolic.names import Names
from symgen.symbolic.system import Group, NamedMatrix

#: Unit and meaning of R and its rates by name.
MOTIONS = {
    name: (
        unit,
        f"R{mark} of S = R p, displacements by the independent ones; in the thesis (D) = [T](D_r)",
    )
    for (name, unit), mark in zip(BASIS, ("", "'", "''"), strict=True)
}
#: The argument of the matrix of free vibrations, and letters of whole matrices.
CONDENSED = Group("condensed", "independent unknowns", (FREE, CONDENSING, *WHOLE.values()))
#: Unit and meaning of the matrix of free vibrations, by its name.
_FREE = (
    entry_unit("N/m"),
    "R^T (K - omega^2 M) R of elastic_stiffness and elastic_mass, with p in its null space; R is [T] and p "
    "is (D_r) of the thesis. Free vibrations in this pose, with R as constant; condensed_stiffness is "
    "R^T (K R + C R' + M R''), with all of K and C, and R as it turns",
)
#: Matrices that R reduces as a constant: name, the whole one, unit, meaning, letter of entries.
_REDUCED = {
    "reduced_stiffness": (
        "elastic_stiffness",
        "N/m",
        "R^T K R with K_i_j of elastic_stiffness: [K_r] of the thesis",
        "K",
    ),
    "reduced_mass": (
        "elastic_mass",
        "kg",
        "R^T M R with M_i_j of elastic_mass: [M_r] of the thesis, by p of condensation; condensed_mass takes "
        "the p of each pose",
        "M",
    ),
    "reduced_gyroscopic": (
        "elastic_gyroscopic",
        "N*s/m",
        "R^T C R with C_i_j of elastic_gyroscopic, of -2 omega A of each link and 2 M times rates of its T; "
        "-2 omega [A_r] of the thesis is without these, and antisymmetric",
        "C",
    ),
    "reduced_load": (
        "elastic_load",
        "N",
        "R^T Q with Q_i of elastic_load: (Q_r) of the thesis, by p of condensation; condensed_load takes "
        "the p of each pose",
        "Q",
    ),
}
#: Unit and meaning of matrices of the independent unknowns that are shown in letters.
REDUCED = {
    "free_vibration": _FREE,
    **{name: (entry_unit(unit), about) for name, (_, unit, about, _) in _REDUCED.items()},
}


def condensed(
    pivots: Sequence[tuple[str, str]],
    joints: Mapping[str, NamedMatrix],
    columns: Sequence[str],
    unknowns: Sequence[str],
    matrices: Mapping[str, sp.ImmutableMatrix],
    names: Names,
) -> list[NamedMatrix]:
    """Return R of S = R p with its rates, and the matrices of p where R is taken as constant.

    Parameters
    ----------
    pivots
        Constraints with the unknowns that depend by them, in the order of elimination.
    joints
        Matrices of all components other than links, with the jacobian of the constraints and its rates.
    columns
        Unknowns of the columns of the jacobian.
    unknowns
        All unknowns, in the order of the assembled ``matrices``.
    names
        Collector of the entries of R and of the matrices.
    """
    rows = joints["jacobian"].rows
    place = {name: k for k, name in enumerate(unknowns)}
    rates = []
    for name in ("jacobian", "jacobian_rate", "jacobian_second_rate"):
        whole = sp.zeros(len(rows), len(unknowns))
        for j, column in enumerate(columns):
            if column in place:
                whole[:, place[column]] = joints[name].matrix[:, j]
        rates.append(sp.ImmutableMatrix(whole))
    at = [(rows.index(row), place[unknown]) for row, unknown in pivots]
    kept = tuple(name for k, name in enumerate(unknowns) if k not in {j for _, j in at})
    chosen = f"; by the drawn pose, p has {', '.join(name for name in kept if name in columns)} of the joints"
    basis = allowed_motions(rates, at, names)
    found = [
        NamedMatrix(name, matrix, unit, about + chosen, tuple(unknowns), kept)
        for (name, (unit, about)), matrix in zip(MOTIONS.items(), basis, strict=True)
    ]
    if rows == THESIS_LINKS:
        crank, _, output = (
            [c for c, x in zip(columns, row, strict=True) if x != 0]
            for row in joints["jacobian"].matrix.tolist()
        )
        if len(crank) == len(output) == 2:
            found[0] = replace(found[0], source=named_condensation(crank, output, kept))
    return [*found, *_reduced(basis[0], kept, matrices, names)]


def _reduced(
    basis: sp.ImmutableMatrix,
    kept: tuple[str, ...],
    matrices: Mapping[str, sp.ImmutableMatrix],
    names: Names,
) -> list[NamedMatrix]:
    """Return R^T M R and so on, over names for the entries of M, and R^T (K - omega^2 M) R."""
    found = []
    for name, (of, *_, letter) in _REDUCED.items():
        matrix, square = matrices[of], of != "elastic_load"

        def entry(
            i: int, j: int, m: sp.ImmutableMatrix = matrix, of: str = of, letter: str = letter
        ) -> sp.Expr:
            called = f"{letter}_{i + 1}" + f"_{j + 1}" * (m.cols > 1)
            text = f"entry {i + 1}" + f", {j + 1}" * (m.cols > 1)
            return names.scalar(called, m[i, j], entry_unit("SI"), f"{text} of {of}")

        entries = sp.ImmutableMatrix(*matrix.shape, entry)
        whole = basis.T * entries * basis if square else basis.T * entries
        whole = sp.ImmutableMatrix(whole.applyfunc(sp.expand))
        columns, symmetric = kept if square else (), name == "reduced_mass"
        found.append(NamedMatrix(name, whole, *REDUCED[name], kept, columns, symmetric, left=reduced(of)))
    stiffness, mass = (m.matrix for m in found[:2])
    equation = sp.ImmutableMatrix(stiffness - FREE.symbol**2 * mass)
    free = NamedMatrix("free_vibration", equation, *_FREE, kept, kept, left=reduced_vibration())
    return [free, *found]
