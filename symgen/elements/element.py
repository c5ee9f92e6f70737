"""Definition of a finite element of a link, and its shape functions from their boundary conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from symgen.errors import DerivationError
from symgen.symbolic.quantity import quantity

LENGTH = quantity("L", "m", "length of the element")
PLACE = quantity("xi", "1", "distance from the first node over the length")


@dataclass(frozen=True, slots=True)
class Dof:
    """An unknown at a place of the element: ``field`` differentiated ``order`` times by x.

    Fields are u, w, the rotation ``phi`` of the section (the slope w' without shear), and the shear strain
    ``gamma`` = w' - phi.
    """

    field: str
    order: int
    unit: str
    description: str


#: Possible unknowns of a node.
NODE_DOFS: dict[str, Dof] = {
    "u": Dof("u", 0, "m", "displacement along the link"),
    "w": Dof("w", 0, "m", "displacement across the link"),
    "theta": Dof("phi", 0, "rad", "rotation of the section"),
    "kappa": Dof("w", 2, "1/m", "curvature"),
}
#: Unknowns inside an element, with their position over its length.
INNER_DOFS: dict[str, tuple[Dof, sp.Expr]] = {
    "mid": (Dof("u", 0, "m", "displacement along the link at mid-length"), sp.Rational(1, 2)),
    "gamma1": (Dof("gamma", 0, "rad", "shear strain at the first node"), sp.Integer(0)),
    "gamma2": (Dof("gamma", 0, "rad", "shear strain at the second node"), sp.Integer(1)),
}


@dataclass(frozen=True, slots=True)
class Element:
    """A finite element of a straight link in the plane.

    Attributes
    ----------
    name, about
        Name in scenes and kernels, and one line of description.
    node_dofs, inner_dofs
        Unknowns at each of its two nodes, of ``NODE_DOFS``, and inside, of ``INNER_DOFS``. Those of the
        element are in the order first node, second node, inner.
    axial, transverse
        Degree of u and of w as polynomials in x.
    rotation
        Degree of the rotation of the section if it is a separate field; None if it is the slope.
    vanishing
        Function of the shear strain that is zero along the element, if the boundary conditions alone do not
        determine the fields.
    rotary
        Whether the rotary inertia of the section is included.
    """

    name: str
    about: str
    node_dofs: tuple[str, ...]
    axial: int
    transverse: int
    inner_dofs: tuple[str, ...] = ()
    rotation: int | None = None
    vanishing: Callable[[sp.Expr], sp.Expr] | None = None
    rotary: bool = False

    @property
    def dofs(self) -> tuple[str, ...]:
        """Names of all unknowns in their order: ``u1``, ``w1``, ... ``u2``, ... and the inner ones."""
        return (*(f"{d}{node}" for node in "12" for d in self.node_dofs), *self.inner_dofs)

    def places(self) -> tuple[tuple[Dof, sp.Expr], ...]:
        """Return each unknown with its position: 0 at the first node, 1 at the second."""
        nodes = tuple((NODE_DOFS[d], sp.Integer(end)) for end in (0, 1) for d in self.node_dofs)
        return (*nodes, *(INNER_DOFS[d] for d in self.inner_dofs))


def entry_unit(unit: str) -> str:
    """Return the unit of entries between displacements, and the factors for angles and curvatures."""
    return f"{unit}; *m per angle, *m^2 per curvature"


@dataclass(frozen=True, slots=True)
class ShapeFunctions:
    """Shape functions of u, w and phi over xi: one entry for each unknown of the element."""

    axial: tuple[sp.Expr, ...]
    transverse: tuple[sp.Expr, ...]
    rotation: tuple[sp.Expr, ...]


def derivative(expression: sp.Expr, order: int = 1) -> sp.Expr:
    """Differentiate a function of xi with respect to x = L xi."""
    return sp.diff(expression, PLACE.symbol, order) / LENGTH.symbol**order if order else expression


@lru_cache(maxsize=32)
def shape_functions(element: Element) -> ShapeFunctions:
    """Solve the shape functions from the conditions at the nodes (thesis Eqs. (5.4)-(5.10), (6.17)).

    Each field is a polynomial with unknown coefficients. The values of all unknowns of the element, and the
    condition ``vanishing`` along it, give as many linear equations as there are coefficients.

    Raises
    ------
    DerivationError
        If the number of conditions differs from that of coefficients, or they do not determine them.
    """
    xi = PLACE.symbol
    fields: dict[str, sp.Expr] = {}
    coefficients: list[sp.Symbol] = []
    degrees = {"u": element.axial, "w": element.transverse, "phi": element.rotation}
    for field, degree in degrees.items():
        if degree is not None:
            unknowns = sp.symbols(f"{field}_0:{degree + 1}")
            coefficients += unknowns
            fields[field] = sp.Add(*(c * xi**k for k, c in enumerate(unknowns)))
    fields.setdefault("phi", derivative(fields["w"]))
    fields["gamma"] = derivative(fields["w"]) - fields["phi"]
    places = element.places()
    rows = [derivative(fields[d.field], d.order).subs(xi, at) for d, at in places]
    if element.vanishing:
        rows += sp.Poly(element.vanishing(fields["gamma"]), xi).all_coeffs()
    if len(rows) != len(coefficients):
        raise DerivationError(
            f"element {element.name}: {len(rows)} conditions for {len(coefficients)} coefficients: "
            "change its degrees or its unknowns"
        )
    values = _solve(element, rows, coefficients, len(places))
    return ShapeFunctions(*(_columns(fields[f], coefficients, values) for f in ("u", "w", "phi")))


def _solve(
    element: Element, rows: Sequence[sp.Expr], coefficients: Sequence[sp.Symbol], unknowns: int
) -> sp.Matrix:
    """Return the coefficients, one column for the unit value of each unknown."""
    matrix, _ = sp.linear_eq_to_matrix(list(rows), list(coefficients))
    unit_values = sp.eye(len(rows))[:, :unknowns]
    try:
        left, right = DomainMatrix.from_Matrix(matrix).to_field().unify(DomainMatrix.from_Matrix(unit_values))
        return left.lu_solve(right).to_Matrix()
    except (ValueError, ZeroDivisionError, sp.polys.matrices.exceptions.DMNonInvertibleMatrixError) as e:
        raise DerivationError(
            f"element {element.name}: its conditions do not determine its shape functions"
        ) from e


def _columns(field: sp.Expr, coefficients: Sequence[sp.Symbol], values: sp.Matrix) -> tuple[sp.Expr, ...]:
    return tuple(
        sp.expand(field.xreplace(dict(zip(coefficients, values[:, k], strict=True))))
        for k in range(values.cols)
    )
