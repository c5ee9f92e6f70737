"""Hamilton's principle for an element in whole vectors and matrices, as the thesis prints it.

The fields are u = N_u S and w = N_w S with the shape functions N of an element. Integrals of their products
over a constant section are the vectors and matrices of Appendix B; the terms of the kinetic energy become
forms of these, which are varied, integrated by parts in time, and collected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import sympy as sp

from symgen.elements.element import LENGTH, entry_unit
from symgen.mechanics.elastic.hamilton import FIELDS, MU, OMEGA, THESIS, VX, VY, X, derive
from symgen.symbolic.quantity import Quantity, bracketed, quantity
from symgen.symbolic.system import Group, NamedMatrix, System

_AS = "symgen show element_beam8"
M = quantity("m", "kg/m", "mass per length of a constant section, m0 of other equations")
TURN = quantity("theta_t", "rad/s", "angular velocity of the link, omega of other equations")
TURN_RATE = quantity("theta_tt", "rad/s^2", "angular acceleration of the link, omega_rate of others")
X1 = quantity("x1_t", "m/s", "velocity of the first point along the link, v_x of other equations")
Y1 = quantity("y1_t", "m/s", "velocity of the first point across the link, v_y of other equations")
X1_RATE = quantity("x1_tt", "m/s^2", "rate of x1_t")
Y1_RATE = quantity("y1_tt", "m/s^2", "rate of y1_t")
T = quantity("T", "J", "kinetic energy of the element")
V = quantity("V", "J", "strain energy of the element, (S)^T [K] (S)/2, without gravity")
#: Letters of the motion of the link, and of energies.
MOTION = M, LENGTH, TURN, TURN_RATE, X1, Y1, X1_RATE, Y1_RATE, T, V
#: Units of whole vectors and matrices stand with the matrices that they are.
_SI = "SI"
#: The unknowns and their rates, their variations, and integrals of shape functions.
STATE = tuple(
    bracketed(f"(S{end})", _SI, about)
    for end, about in (
        ("", f"unknowns of the element: columns of {_AS} shape"),
        ("_t", "rates of (S)"),
        ("_tt", "second rates of (S)"),
    )
)
VARIED = tuple(bracketed(f"delta{x.name}", _SI, f"variation of {x.name}") for x in STATE[:2])
VARIED_ENERGY = tuple(bracketed(f"delta({x.name})", "J", f"variation of {x.name}") for x in (T, V))
VECTORS = {
    (field, power): bracketed(
        f"({letter})", _SI, f"integral of {'x ' * power}N_{field}^T; times m: {_AS} constant_{load}"
    )
    for letter, field, power, load in (
        ("E", "u", 0, "load_x"),
        ("G", "w", 0, "load_y"),
        ("N", "u", 1, "load_out"),
        ("L", "w", 1, "load_turn"),
    )
}
POLYNOMIAL = bracketed("(A)", _SI, f"coefficients of u and w: rows of {_AS} inverse_coefficients")
COEFFICIENTS = bracketed("[C]", _SI, f"unknowns by coefficients of u and w: {_AS} coefficients")
_A, _B, _MASS = (
    bracketed(f"[{letter}]", _SI, f"integral of N_{of[0]}^T N_{of[1]}: {_AS} {letter}")
    for letter, of in (("A", "uw"), ("B", "uu"), ("M", "ww"))
)
STIFFNESS, MD, AD, KD, Q = (
    bracketed(letter, _SI, f"{about}: {_AS} {name}")
    for letter, about, name in (
        ("[K]", "stiffness", "constant_stiffness"),
        ("[MD]", "m [M] + m [B]", "constant_mass"),
        ("[AD]", "m [A] - m [A]^T", "constant_gyroscopic"),
        ("[KD]", "[K] - theta'^2 [MD] - theta'' [AD]", "KD"),
        ("(Q)", "load of the rigid motion", "Q, with gravity"),
    )
)
LETTERS = (
    *STATE,
    POLYNOMIAL,
    COEFFICIENTS,
    *VARIED,
    *VARIED_ENERGY,
    *VECTORS.values(),
    _A,
    _B,
    _MASS,
    STIFFNESS,
    MD,
    AD,
    KD,
    Q,
)
#: Integrals of products of shape functions, by both fields.
_PRODUCTS = {
    "uu": _B.symbol, "uw": _A.symbol, "wu": sp.transpose(_A.symbol), "ww": _MASS.symbol
}  # fmt: skip
_S, _S_T, _S_TT = (x.symbol for x in STATE)
_DS, _DS_T = (x.symbol for x in VARIED)
_THESIS = {MU: M, OMEGA: TURN, VX: X1, VY: Y1}
_RATES = {TURN: TURN_RATE, X1: X1_RATE, Y1: Y1_RATE}


@dataclass(frozen=True, slots=True)
class _Term:
    """Term factor * row * variation: the row is (E)^T, or (S)^T [B] with a rate of S of order ``order``.

    ``varied`` is the order of the rate of S that is varied.
    """

    factor: sp.Expr
    matrix: sp.Expr
    order: int | None
    varied: int

    @property
    def row(self) -> sp.Expr:
        return self.matrix if self.order is None else sp.transpose(STATE[self.order].symbol) * self.matrix


def element_equations() -> System:
    """Return the equations (5.16), (5.17), (6.13), (7.7), (7.9), (7.23) and (7.28) in letters; no kernels."""
    return _system(
        "elastic_link_letters", "Elastic link in vectors and matrices", (*MOTION, *LETTERS), _of_element()
    )


def assembly_equations() -> System:
    """Return the equation (8.1) in letters; no kernels."""
    return _system("assembly_letters", "Elastic linkage by its elements", ASSEMBLED, _assembled())


def condensed_equations() -> System:
    """Return the equations (E.22)-(E.29) in letters; no kernels."""
    return _system("condensed_letters", "Elastic linkage with independent unknowns", CONDENSED, _condensed())


def _system(name: str, title: str, letters: tuple[Quantity, ...], equations: Iterable[NamedMatrix]) -> System:
    group = Group("letters", title, letters)
    return System(name, title, (group,), tuple(equations), (), references=(THESIS,))


def _equation(name: str, left: sp.Expr, right: sp.Expr, unit: str, about: str, source: str) -> NamedMatrix:
    return NamedMatrix(name, sp.ImmutableMatrix([[right]]), unit, about, source=f"thesis {source}", left=left)


def _of_element() -> Iterator[NamedMatrix]:
    m = M.symbol
    products = [_product(e) for e in _kinetic()]
    kinetic = (
        sp.Rational(1, 2) * m * _sum(2 * factor / m * _form(fields, k) for factor, fields, k in products)
    )
    strain = sp.transpose(_S) * STIFFNESS.symbol
    yield _equation(
        "unknowns_of_element", _S, COEFFICIENTS.symbol * POLYNOMIAL.symbol, _SI,
        "unknowns of the element by the coefficients of u and w", "(5.16)",
    )  # fmt: skip
    yield _equation(
        "coefficients_of_element", POLYNOMIAL.symbol, COEFFICIENTS.symbol**-1 * _S, _SI,
        "coefficients of u and w by the unknowns of the element", "(5.17)",
    )  # fmt: skip
    yield _equation(
        "kinetic_energy_of_element", T.symbol, kinetic, "J",
        "kinetic energy of an element of constant section; symgen adds rotary inertia", "(6.13)",
    )  # fmt: skip
    yield _equation(
        "lagrangian_of_element", T.symbol - V.symbol, _sum([kinetic, -strain * _S / 2]), "J",
        "energies of an element of constant section, without gravity at its rigid place", "(7.7)",
    )  # fmt: skip
    varied = [term for product in products for term in _varied(*product)]
    forms = (term.factor / m * term.row * VARIED[term.varied].symbol for term in varied)
    yield _equation(
        "variation_of_element", VARIED_ENERGY[0].symbol - VARIED_ENERGY[1].symbol,
        _sum([m * _sum(forms), -strain * _DS]), "J",
        "variation by the unknowns, equal terms added; symgen adds the work of gravity, of the axial force "
        "and of forces along the link, rotary inertia and shear", "(7.8), (7.9)",
    )  # fmt: skip
    by_parts = [part for term in varied for part in _by_parts(term)]
    stiffness = _sum([STIFFNESS.symbol, *_collected(by_parts, 0)])
    rates = [sp.transpose(STATE[k].symbol) * _sum(_collected(by_parts, k)) for k in (2, 1)]
    loads = (term.factor * term.row for term in by_parts if term.order is None)
    yield _equation(
        "motion_of_element", _sum([*rates, sp.transpose(_S) * stiffness]), _sum(loads), entry_unit("N"),
        "equation of motion of an element in axes of the link, by rows, without gravity and geometric "
        "stiffness, which load_terms and stiffness_terms have", "(7.20)-(7.22), (7.23)",
    )  # fmt: skip
    turning = -2 * TURN.symbol * AD.symbol * _S_T
    yield _equation(
        "equation_of_element", _sum([MD.symbol * _S_TT, turning, KD.symbol * _S]), Q.symbol, entry_unit("N"),
        "equation of motion of an element in axes of the link, by columns, without geometric stiffness, "
        "which stiffness_terms has", "(7.28)",
    )  # fmt: skip


def _kinetic() -> tuple[sp.Expr, ...]:
    """Return the terms of the kinetic energy per length in the order of Appendix A, but for rotary ones."""
    step = next(step for step in derive().steps if step.name == "kinetic_terms")
    thesis = {mine.symbol: its.symbol for mine, its in _THESIS.items()}
    rows = zip(step.rows, step.expressions, strict=True)
    return tuple(e.xreplace(thesis) for row, e in rows if row.startswith("A."))


def _product(term: sp.Expr) -> tuple[sp.Expr, tuple[str, ...], int]:
    """Return a term as its factor, its fields, that of u first, and its power of x."""
    powers = term.as_powers_dict()
    fields = [name for name, q in FIELDS.items() for _ in range(int(powers.pop(q.symbol, 0)))]
    power = int(powers.pop(X.symbol, 0))
    return sp.Mul(*(base**k for base, k in powers.items())), tuple(sorted(fields, key=lambda x: x[0])), power


def _form(fields: tuple[str, ...], power: int) -> sp.Expr:
    """Return the integral of fields times a power of x over the element, as a form of S and its rates."""
    if not fields:
        return LENGTH.symbol ** (power + 1) / (power + 1)
    return _row(fields[:-1], fields[-1], power).row * STATE[_order(fields[-1])].symbol


def _row(others: tuple[str, ...], field: str, power: int) -> _Term:
    """Return the row by which the integral of fields times a power of x is linear in ``field``."""
    if not others:
        return _Term(sp.S.One, sp.transpose(VECTORS[field[0], power].symbol), None, _order(field))
    return _Term(sp.S.One, _PRODUCTS[others[0][0] + field[0]], _order(others[0]), _order(field))


def _order(field: str) -> int:
    return field.count("t")


def _varied(factor: sp.Expr, fields: tuple[str, ...], power: int) -> Iterator[_Term]:
    """Yield the variations of a term; those of unknowns come before those of rates."""
    for field in sorted(dict.fromkeys(fields), key=_order):
        others = list(fields)
        others.remove(field)
        yield replace(_row(tuple(others), field, power), factor=factor * fields.count(field))


def _by_parts(term: _Term) -> Iterator[_Term]:
    """Yield a term without the variation of a rate: (7.10)-(7.18)."""
    if not term.varied:
        yield term
        return
    rate = sp.Add(*(sp.diff(term.factor, x.symbol) * of.symbol for x, of in _RATES.items()))
    if rate != 0:
        yield replace(term, factor=-rate, varied=0)
    if term.order is not None:
        yield replace(term, factor=-term.factor, order=term.order + 1, varied=0)


def _collected(terms: Iterable[_Term], order: int) -> list[sp.Expr]:
    """Return the matrices, with their factors, behind the rate of S of an order, on the left side."""
    return [-term.factor * term.matrix for term in terms if term.order == order]


def _sum(terms: Iterable[sp.Expr]) -> sp.Expr:
    """Return a sum in the order of its terms."""
    return sp.Add(*terms, evaluate=False)


#: Letters of a linkage with independent unknowns, and where its matrices are shown.
_OF = "symgen show SCENE"
FREE = quantity("omega_free", "rad/s", "angular frequency of free vibrations")
INDEPENDENT = tuple(
    bracketed(f"(D_r{end})", _SI, about)
    for end, about in (
        ("", "independent unknowns, p of condensation"),
        ("_t", "rates of (D_r)"),
        ("_tt", "second rates of (D_r)"),
    )
)
CONDENSING = bracketed("[T]", _SI, f"(D) = [T] (D_r), R elsewhere: {_OF} condensation, as of thesis_rig")
WHOLE = {
    name: bracketed(letter, _SI, f"of the linkage: {_OF} {shown}")
    for name, letter, shown in (
        ("elastic_stiffness", "[K]", "elastic_stiffness"),
        ("elastic_mass", "[M]", "elastic_mass"),
        ("elastic_gyroscopic", "[C]", "elastic_gyroscopic, by -2 theta' [A] of links"),
        ("elastic_load", "(Q)", "elastic_load"),
        ("whole", "[KT]", "elastic_stiffness, elastic_motion_stiffness"),
    )
}
ASSEMBLY = bracketed("[Z]", _SI, f"unknowns of the elements by those of the linkage: {_OF} assembly")
OF_ELEMENTS = tuple(
    bracketed(f"[K{k}]", _SI, f"of element {k} in fixed axes: [T][K][T]^T, [K] of {_OF} LINK.stiffness")
    for k in (1, 2, 3)
)
ASSEMBLED = ASSEMBLY, *OF_ELEMENTS, WHOLE["elastic_stiffness"]
CONDENSED = FREE, *INDEPENDENT, CONDENSING, *WHOLE.values()


def _assembled() -> Iterator[NamedMatrix]:
    z = ASSEMBLY.symbol
    diagonal = sp.Function("diag")(*(x.symbol for x in OF_ELEMENTS))
    yield _equation(
        "stiffness_of_linkage", WHOLE["elastic_stiffness"].symbol, sp.transpose(z) * diagonal * z,
        entry_unit("N/m"), "stiffness of the linkage by those of its elements in fixed axes, as for other "
        "matrices; elastic_stiffness and so on leave out the unknowns of boundary, which are zero",
        "(8.1)",
    )  # fmt: skip


def reduced(name: str) -> sp.Expr:
    """Return [T]^T [K] [T], or [T]^T (Q), of an assembled matrix or load."""
    whole = sp.transpose(CONDENSING.symbol) * WHOLE[name].symbol
    return whole if name == "elastic_load" else whole * CONDENSING.symbol


def reduced_vibration() -> sp.Expr:
    """Return [T]^T [K] [T] - omega^2 [T]^T [M] [T]."""
    return _sum([reduced("elastic_stiffness"), -(FREE.symbol**2) * reduced("elastic_mass")])


def _condensed() -> Iterator[NamedMatrix]:
    constant = (
        "of the independent unknowns, where links are inextensible or rigid (elastic.axial = false). [T] is "
        "constant as in the thesis; condensed_damping and condensed_stiffness have its rates"
    )
    at, rate, second = (x.symbol for x in INDEPENDENT)
    yield _equation(
        "condensed_vibration", reduced_vibration() * at, sp.S.Zero, entry_unit("N"),
        f"free vibrations {constant}", "(E.22)-(E.25)",
    )  # fmt: skip
    terms = reduced("elastic_mass") * second, reduced("elastic_gyroscopic") * rate, reduced("whole") * at
    yield _equation(
        "condensed_motion", _sum(terms), reduced("elastic_load"), entry_unit("N"),
        f"equation of motion {constant}. Its products are [M_r], -2 theta' [A_r], [K_r] and (Q_r)",
        "(E.26)-(E.28), (E.29)",
    )  # fmt: skip
