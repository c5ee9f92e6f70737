"""Derivation steps common to all elements of elastic links, as a system for inspection: no kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from symgen.elements.element import LENGTH, PLACE, Element, derivative, entry_unit, shape_functions
from symgen.mechanics.elastic.beam_matrices import (
    ElementSection,
    beam_matrices,
    shape_products,
    strain_energy,
)
from symgen.mechanics.elastic.hamilton import (
    APPLIED,
    FIELDS,
    MOTION,
    MU,
    PATH,
    PLUS,
    SECTION,
    THESIS,
    X,
    derive,
)
from symgen.mechanics.elastic.letters import COEFFICIENTS
from symgen.mechanics.elastic.moving_frame import POINT, POINT_RATES, from_fixed_axes
from symgen.mechanics.elastic.turning_axes import COSINE, SINE, local_equation, transformation
from symgen.models.elastic.element import SHOWN
from symgen.models.elastic.fixed_axes import LOAD, TURNED
from symgen.symbolic.quantity import Quantity, quantity, times_lengths, whole
from symgen.symbolic.system import NO_SOURCE, Definition, Group, NamedMatrix, System

#: Of a constant section, as in the matrices of an element.
_MASS = quantity("m0", "kg/m", "mass per length")
#: Numbers of the equations (D.5)-(D.22) that have errata.
_ERRATA = 19, 20
#: Powers of the unit of length in mode functions by the unit of their unknown.
_POWERS = {"m": 0, "rad": 1, "1/m": 2}
#: Coefficients of x^k in u, which are B, and in w, which are A, in the order of the thesis.
_POLYNOMIALS = ("u", 0), ("w", 0), ("w", 1), ("w", 2), ("u", 1), ("w", 3), ("w", 4), ("w", 5)


def elastic_derivation_system(element: Element | None = None) -> System:
    """Return the steps of Hamilton's principle for a link, each with the source's equation numbers.

    With an element, integrals of its shape functions and the transformation to fixed axes follow.
    """
    steps = derive().steps if element is None else (*derive().steps, *from_fixed_axes())
    matrices = tuple(
        NamedMatrix(
            step.name,
            sp.ImmutableMatrix(len(step.rows), len(step.columns) or 1, step.expressions),
            step.unit,
            step.about,
            step.rows,
            step.columns,
            source=NO_SOURCE if step.source.startswith("not in") else f"thesis {step.source}",
        )
        for step in steps
    )
    of_element, groups, definitions = list[NamedMatrix](), list[Group](), list[Definition]()
    if element is not None:
        of_element += _of_element(element)
        groups.append(
            Group("element", "length, direction and mass of the link", (LENGTH, COSINE, SINE, _MASS))
        )
        groups.append(
            Group("point", "first point of the link in fixed axes, and its velocity", (*POINT, *POINT_RATES))
        )
        if element.name == SHOWN:
            about = ((d, *place) for d, place in zip(element.dofs, element.places(), strict=True))
            unknowns = [
                quantity(d, x.unit, f"{x.description} at node {1 + at}, q{k} of the thesis")
                for k, (d, x, at) in enumerate(about, 1)
            ]
            rates = [quantity(f"{q.name}_t", f"{q.unit}/s", f"rate of {q.name}") for q in unknowns]
            groups.append(Group("unknowns", "unknowns of the element and their rates", (*unknowns, *rates)))
            groups.append(Group("coefficients", "unknowns by coefficients of u and w", (COEFFICIENTS,)))
            energy, definitions = _energy(element, unknowns)
            load, entries = _load(element)
            of_element += [*_coefficients(element), *_fields(element, unknowns, rates), *energy, load]
            definitions += entries
    return System(
        "elastic_link_derivation",
        "Elastic link by Hamilton's principle, step by step",
        (
            Group("fields", "displacements, their rates, and strains", tuple(FIELDS.values())),
            Group("motion", "rigid motion of the link", (*MOTION, *APPLIED, *PATH)),
            Group("section", "properties at x", SECTION),
            *groups,
        ),
        (*matrices, *of_element),
        (),
        tuple(definitions),
        references=(THESIS,),
    )


def _of_element(element: Element) -> Iterator[NamedMatrix]:
    names = element.dofs
    for name, (matrix, product, rows, source) in shape_products(element).items():
        about = f"[{name}]: integral of {product} over x, with {rows} of shape"
        text, left = f"thesis {source}", whole(f"[{name}]")
        yield NamedMatrix(name, matrix, entry_unit("m"), about, names, names, source=text, left=left)
    about = "T of S = T s: displacements in the link's axes, s, to those in fixed axes, S"
    turned = transformation(element)
    yield NamedMatrix(
        "transformation",
        turned,
        "1",
        about,
        names,
        names,
        source="thesis (E.1)-(E.7); (E.9), (E.14): its transpose",
    )


def _coefficients(element: Element) -> Iterator[NamedMatrix]:
    """Yield the unknowns by the coefficients of u and w as polynomials in x, and the inverse."""
    x, fields = X.symbol, {"phi": ("w", 1)}  # without shear the section turns by the slope w'
    rows = []
    for dof, end in element.places():
        field, order = fields.get(dof.field, (dof.field, 0))
        rows.append(
            [
                sp.diff(x**k, x, order + dof.order).subs(x, end * LENGTH.symbol) if of == field else 0
                for of, k in _POLYNOMIALS
            ]
        )
    matrix = DomainMatrix.from_Matrix(sp.Matrix(rows)).to_field()
    names = tuple(f"{'B' if of == 'u' else 'A'}{k}" for of, k in _POLYNOMIALS)
    about = "u = B0 + B1 x and w = A0 + A1 x + ... + A5 x^5"
    conditions = "; ".join(f"{dof} (5.{k})" for k, dof in enumerate(element.dofs, 8))
    yield NamedMatrix(
        "coefficients", sp.ImmutableMatrix(rows), "SI", f"unknowns by the coefficients of {about}",
        element.dofs, names, source=f"thesis (5.16), (5.18); {conditions}", left=COEFFICIENTS.symbol,
    )  # fmt: skip
    yield NamedMatrix(
        "inverse_coefficients", sp.ImmutableMatrix(matrix.inv().to_Matrix()), "SI",
        f"coefficients of {about} by the unknowns", names, element.dofs, left=COEFFICIENTS.symbol**-1,
        source="thesis (5.17), (B.8); (5.23), corrected: A5 by theta2 is printed -3/L^5",
    )  # fmt: skip


def _fields(
    element: Element, unknowns: Sequence[Quantity], rates: Sequence[Quantity]
) -> Iterator[NamedMatrix]:
    """Yield the fields by the unknowns, the conditions on mode functions, and integrals of kinetic energy."""
    shape, x = shape_functions(element), X.symbol
    rows = {"u": shape.axial, "w": shape.transverse}
    fields = {
        name + ending: sp.Add(*(e * q.symbol for e, q in zip(row, of, strict=True)))
        for ending, of in (("", unknowns), ("_t", rates))
        for name, row in rows.items()
    }
    fields = {name: e.xreplace({PLACE.symbol: x / LENGTH.symbol}) for name, e in fields.items()}
    about = "displacements and their rates at x: the same functions of the unknowns and of their rates"
    yield NamedMatrix(
        "displacements", sp.ImmutableMatrix([*fields.values()]), "m, m, m/s, m/s", about, tuple(fields),
        source="thesis (5.19)-(5.22), (6.16), (6.19), (6.22); u (5.20), (6.16), (6.19); u_t (5.22); "
        "w (5.19), (6.22), (D.1); w_t (5.21)",
    )  # fmt: skip
    yield from _conditions(element, unknowns)
    terms = next(step for step in derive().steps if step.name == "kinetic_terms")
    known = {FIELDS[name].symbol: e for name, e in fields.items()}
    integrals = {
        row: sp.factor(sp.integrate(sp.expand((2 * e / MU.symbol).xreplace(known)), (x, 0, LENGTH.symbol)))
        for row, e in zip(terms.rows, terms.expressions, strict=True)
        if row.startswith("A.")
    }
    yield NamedMatrix(
        "kinetic_integrals", sp.ImmutableMatrix([*integrals.values()]), "m^3/s^2",
        "integrals of the kinetic terms over an element of constant mass per length m, times 2/m",
        tuple(integrals),
        source=f"thesis (A.3)-(A.19), the fields inserted; {PLUS}",
    )  # fmt: skip


def _conditions(element: Element, unknowns: Sequence[Quantity]) -> Iterator[NamedMatrix]:
    """Yield the fields at the ends, and the conditions on mode functions, whose rows state them."""
    shape = shape_functions(element)
    of = {"u": ("u", shape.axial), "w": ("w", shape.transverse), "phi": ("w'", shape.rotation)}
    fields, modes = dict[str, sp.Expr](), dict[str, tuple[sp.Expr, str]]()
    for own, (dof, at) in enumerate(element.places()):
        name, row = of[dof.field]  # the slope w' is the rotation of a section without shear
        end, marks = "L" if at else "0", f"{name[1:]}{chr(39) * dof.order}"
        values = [derivative(e, dof.order).xreplace({PLACE.symbol: at}) for e in row]
        terms = [e * q.symbol for e, q in zip(values, unknowns, strict=True)]
        fields[f"{name[0]}{marks}({end}) = q{own + 1}"] = sp.Add(*terms)
        for k, e in enumerate(row):
            if e != 0:
                unit = times_lengths("1", _POWERS[unknowns[k].unit] - len(marks))
                modes[f"phi{k + 1}{marks}({end}) = {int(k == own)}"] = values[k], unit
    yield NamedMatrix(
        "end_conditions", sp.ImmutableMatrix([*fields.values()]), ", ".join(q.unit for q in unknowns),
        "fields and their derivatives at both ends, which are the unknowns", tuple(fields),
        source="thesis, Appendix C; u(0) (C.1); u(L) (C.2); w* (C.14)",
    )  # fmt: skip
    rows = sorted(modes, key=lambda row: row[: len("phi1")])
    yield NamedMatrix(
        "mode_conditions", sp.ImmutableMatrix([modes[row][0] for row in rows]),
        ", ".join(modes[row][1] for row in rows),
        "mode functions phi of the unknowns, and their derivatives, at both ends", tuple(rows),
        source="thesis, Appendix C; phi1(0) (C.3), (C.8); phi1(L) (C.4), (C.9); phi5(0) (C.5), (C.11); "
        "phi5(L) (C.6), (C.12); phi2* (C.15)",
    )  # fmt: skip


def _load(element: Element) -> tuple[NamedMatrix, list[Definition]]:
    """Return the load of a constant section in fixed axes, and the letters of that in link axes."""
    load = local_equation(beam_matrices(element, ElementSection((_MASS.symbol,), (), (), (), ()))).load
    letters = [quantity(f"Q_{k}", entry_unit("N"), f"entry {k} of Q") for k in range(1, load.rows + 1)]
    turned = transformation(element) * sp.Matrix([q.symbol for q in letters])
    about = f"(QT) {LOAD} {TURNED}, of a constant section"
    matrix = sp.ImmutableMatrix(turned)
    source = "thesis (E.20), (F.8), by the virtual work (E.18), (E.19)"
    known = [Definition(q, e) for q, e in zip(letters, load, strict=True)]
    left = whole("(QT)")
    return NamedMatrix("QT", matrix, entry_unit("N"), about, element.dofs, source=source, left=left), known


def _energy(element: Element, unknowns: Sequence[Quantity]) -> tuple[list[NamedMatrix], list[Definition]]:
    """Return the steps to the strain energy of a constant section, and the letters in them."""
    steps = strain_energy(element, [q.symbol for q in unknowns])
    units = ["1/m", *(f"1/m^{k}" for k in range(2, len(steps.products) + 2))]
    about = "by powers of x"
    square = f"coefficients of the squared curvature {about}"
    curvature = [
        Definition(quantity(f"a{k}", unit, f"coefficient of the curvature {about}"), e)
        for k, (e, unit) in enumerate(zip(steps.coefficients, units, strict=False))
    ]
    squared = [
        Definition(quantity(f"D{k}", unit, f"coefficient of the squared curvature {about}"), e)
        for k, (e, unit) in enumerate(zip(steps.products, units[1:], strict=True))
    ]
    known = {d.quantity.symbol: d.expression for d in curvature}

    def column(
        name: str, about: str, source: str, rows: Sequence[str], entries: Sequence[sp.Expr], unit: str
    ) -> NamedMatrix:
        matrix = sp.ImmutableMatrix(len(entries), 1, entries)
        return NamedMatrix(name, matrix, unit, about, tuple(rows), source=f"thesis {source}")

    def coefficients(
        name: str, about: str, source: str, first: int, of: Sequence[Definition], entries: Sequence[sp.Expr]
    ) -> NamedMatrix:
        rows = [d.quantity.name for d in of]
        numbers = "; ".join(
            f"{row} (D.{k})" + ", corrected" * (k in _ERRATA) for k, row in enumerate(rows, first)
        )
        units = ", ".join(d.quantity.unit for d in of)
        return column(name, about, f"{source}; {numbers}", rows, entries, units)

    in_unknowns = [sp.expand(e.xreplace(known)) for e in steps.products]
    both = steps.axial + steps.bending
    matrices = [
        coefficients("curvature_coefficients", f"coefficients of the curvature {about}", "(D.5)-(D.8)", 5,
                     curvature, steps.coefficients),
        coefficients("squared_curvature_coefficients", square, "(D.9)-(D.15)",
                     9, squared, steps.products),
        coefficients("squared_curvature_of_unknowns", f"{square}, in the unknowns",
                     "(D.16)-(D.22)", 16, squared, in_unknowns),
        column("squared_curvature", "square of the curvature at x", "(D.23), (D.24)", (), [steps.polynomial],
               "1/m^2"),
        column("potential_energy", "strain energy of an element with a constant section",
               "(6.30), without gravity; axial (6.20), (6.21); bending (6.29), (D.25)-(D.27); sum (6.30)",
               ("axial", "bending", "sum"), [steps.axial, steps.bending, both], "J"),
    ]  # fmt: skip
    return matrices, [*curvature, *squared]
