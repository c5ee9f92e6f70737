"""Every readable entry of the thesis' Appendices B and F against the matrices that symgen derives.

The print is corrected by the list of errata; each erratum must really differ in print.
"""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import pytest
import sympy as sp
from shared.commands import call
from shared.elastic_notation import UNREADABLE, Printed, value
from shared.elastic_print import (
    ERRATA,
    LETTER_ERRATA,
    MATRICES,
    MOMENTS,
    PRODUCTS,
    SHAPE_ERRATA,
    SHAPES,
)

from symgen.elements import ELEMENTS
from symgen.elements.element import LENGTH, PLACE, shape_functions
from symgen.mechanics.elastic.beam_matrices import ElementSection, beam_matrices
from symgen.models import BLOCKS, element
from symgen.models.elastic.derivation import elastic_derivation_system

L, m, x, C, S = sp.symbols("L m x C S")
w, a, X, Y, p, r = sp.symbols("w a X Y p r")
EA, EI = sp.symbols("EA EI")
#: Entries whose signs the scan has lost: compared by their size.
SIZES = ("F.7",)


@cache
def shapes():
    """Shape functions of u and of w over x, eight each."""
    found = shape_functions(ELEMENTS["beam8"])
    known = {PLACE.symbol: x / L, LENGTH.symbol: L}
    return tuple([sp.expand(e.xreplace(known)) for e in row] for row in (found.axial, found.transverse))


def shown_in_thesis_form() -> dict[str, sp.Matrix]:
    """Return what ``symgen show element_beam8 thesis_...``, ``KD``, ``KT`` and ``Q`` print, in the thesis' letters."""
    system = element("beam8")
    uniform = {"m0": m, "a0": EA, "b0": EI, "L": L, "omega": w, "omega_rate": a, "c": C, "s": S}
    uniform |= {"ax": p - w * Y, "ay": r + w * X}
    known: dict[sp.Symbol, sp.Expr] = {
        q.symbol: uniform.get(q.name, sp.S.Zero) for group in system.groups for q in group.quantities
    }
    for definition in system.definitions:
        known[definition.quantity.symbol] = sp.expand(definition.expression.xreplace(known))
    return {
        of.name.removeprefix("thesis_"): sp.Matrix(of.matrix.xreplace(known))
        for of in system.matrices
        if of.name.startswith("thesis_") or of.name in ("KD", "KT", "Q")
    }


@cache
def derived() -> dict[str, sp.Matrix]:
    """Return symgen's matrices by the number of the print's matrix."""
    none = (sp.S.Zero,)
    found = beam_matrices(ELEMENTS["beam8"], ElementSection((m,), none, (EA,), (EI,), none))

    def plain(matrix):
        return sp.Matrix(matrix).xreplace({LENGTH.symbol: L})

    mass, turning, stiffness = plain(found.mass), plain(found.gyroscopic), plain(found.stiffness)
    kept = {"E": found.load_x, "G": found.load_y, "N": found.load_out, "L": found.load_turn}
    E, G, N, turn = (plain(load) / m for load in kept.values())
    T = sp.eye(8)
    for i in (0, 4):
        T[i : i + 2, i : i + 2] = sp.Matrix([[C, -S], [S, C]])
    shown = shown_in_thesis_form()
    axial = [0, 4]
    parts = [[w * Y * E[i] + w * X * G[i], p * E[i] + r * G[i], w**2 * N[i] + a * turn[i]] for i in range(8)]
    u, across = shapes()
    stretch = sp.Matrix(8, 8, lambda i, j: mass[i, j] / m if i in axial and j in axial else 0)
    crossed = sp.Matrix(8, 8, lambda i, j: turning[i, j] / m if i in axial else 0)
    coefficients = sp.Matrix(
        [
            [sp.Poly(f, x).coeff_monomial(x**k) for f in field]
            for field, k in ((u, 0), (across, 0), (across, 1), (across, 2), (u, 1), *((across, k) for k in (3, 4, 5)))
        ]
    )  # fmt: skip
    return {
        "5.23": coefficients,
        "B.8": coefficients,
        "B.10": stretch,
        "B.14": crossed,
        "B.15": crossed.T,
        "B.16": G.T,
        "B.17": mass - m * stretch,
        "B.18": N.T,
        "B.19": turn.T,
        "D.28": stiffness,
        "F.1": mass,
        "T F.1": T * mass,
        "F.2": shown["mass"],
        "F.3": turning,
        "T F.3": T * turning,
        "F.4": shown["damping"] / (-2 * w),
        "F.5": shown["KD"],
        "T F.5": T * shown["KD"],
        "F.6": shown["KT"],
        "F.7": sp.Matrix(parts),
        "F.8": shown["load"].T,
    }


def same(one, two) -> bool:
    """Whether two expressions are equal, with the square of the sine eliminated."""
    difference = sp.expand(one - two)
    return sp.expand(difference.xreplace({S**2: 1 - C**2})) == 0


def entries(name: str, printed: Printed, ours: sp.Matrix):
    """Yield place, entry as read and as corrected (None where unreadable), and derived."""
    letters, right = printed.letters, printed.letters
    if name.removeprefix("T ") in ("F.5", "F.6"):
        right = letters | LETTER_ERRATA
    assert (len(printed.rows), len(printed.rows[0])) == ours.shape
    for i, row in enumerate(printed.rows):
        assert len(row) == ours.cols
        for j, text in enumerate(row):
            place = (name, i + 1, j + 1)
            if text == UNREADABLE:
                assert place not in ERRATA
                yield place, None, None, ours[i, j]
            else:
                corrected = ERRATA.get(place, text)
                yield place, value(text, letters), value(corrected, right), ours[i, j]


@pytest.mark.parametrize("name", MATRICES)
def test_matrices(name):
    listed = {place for place in ERRATA if place[0] == name}
    for place, read, corrected, ours in entries(name, MATRICES[name], derived()[name]):
        if read is None:
            continue
        holds = same(corrected, ours) or (name in SIZES and same(corrected, -ours))
        assert holds, f"{place}: {corrected} is not {ours}"
        if read != corrected:
            assert not same(read, ours), f"{place} is right in print: not an erratum"
            listed.discard(place)
    assert not listed, f"errata that do not differ in print: {listed}"


@pytest.mark.parametrize("name", SHAPES)
def test_shape_functions(name):
    number = int(name.split()[1]) - 1
    ours = shapes()[number not in (0, 4)][number]
    assert same(value(SHAPE_ERRATA.get(name, SHAPES[name])), ours)
    if name in SHAPE_ERRATA:
        assert not same(value(SHAPES[name]), ours)


@pytest.mark.parametrize("name", [name for name, text in PRODUCTS.items() if text != UNREADABLE])
def test_products_of_shape_functions(name):
    u, across = shapes()
    one, two = (int(n) - 1 for n in name.split())
    assert same(value(PRODUCTS[name]), (u if one in (0, 4) else across)[one] * across[two])


@pytest.mark.parametrize("name", [name for name, text in MOMENTS.items() if text != UNREADABLE])
def test_powers_times_shape_functions(name):
    power, number = (int(n) for n in name.split())
    assert same(value(MOMENTS[name]), x**power * shapes()[1][number - 1])


def test_the_integrals_follow_from_the_products():
    """B.14 and B.17 are the integrals of the products that the same appendix prints before them."""
    for name, text in PRODUCTS.items():
        if text == UNREADABLE:
            continue
        i, j = (int(n) - 1 for n in name.split())
        ours = derived()["B.14"][i, j] if i in (0, 4) else derived()["B.17"][i, j] / m
        assert same(sp.integrate(value(text), (x, 0, L)), ours)


def test_the_form_of_the_thesis_with_a_constant_section_has_the_printed_matrices():
    shown = shown_in_thesis_form()
    for tapered, printed in (("local_stiffness", "KD"), ("stiffness", "KT")):
        assert all(same(one, two) for one, two in zip(shown[tapered], shown[printed], strict=True))
    T = elastic_derivation_system(ELEMENTS["beam8"])["transformation"].matrix
    T = T.xreplace({sp.Symbol(name, real=True): known for name, known in (("c", C), ("s", S))})
    assert all(same(one, two) for one, two in zip(T * shown["Q"], shown["load"], strict=True))


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("thesis_local_stiffness", "(F.5)"),
        ("thesis_stiffness", "(F.6)"),
        ("KD", "(F.5)"),
        ("KT", "(F.6)"),
    ],
)
def test_a_command_prints_the_dynamic_stiffness(name, number):
    printed = call("show", "element_beam8", name)
    assert number in printed and "ω" in printed and "thesis" in printed and "N0" not in printed
    assert "N0" in call("show", "element_beam8", "global_stiffness")


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("mass", "F.1"),
        ("gyroscopic", "F.3"),
        ("stiffness", "D.28"),
        ("load_y", "B.16"),
        ("load_out", "B.18"),
        ("load_turn", "B.19"),
    ],
)
def test_matrices_of_a_constant_section_are_the_printed_ones(name, number):
    """Those that ``symgen show element_beam8 constant_mass`` and the others print."""
    system = BLOCKS["element_beam8"]()
    shown = system[f"constant_{name}"]
    symbols = {LENGTH.symbol: L} | {
        sp.Symbol(known, real=True): letter for known, letter in (("m0", m), ("a0", EA), ("b0", EI))
    }
    ours = shown.matrix.xreplace(symbols)
    assert number in shown.source
    assert sp.simplify(
        ours - (m * derived()[number].T if name.startswith("load") else derived()[number])
    ) == sp.zeros(*ours.shape)


def test_constant_sections_of_other_elements_are_those_of_textbooks():
    """Of beams with cubic deflection, after elimination of the shear strains; the section may shear and turn."""
    mass, stiffness, shear, inertia = sp.symbols("m0 b0 s0 j0", real=True)
    length = LENGTH.symbol
    bent = sp.Matrix([[12, 6 * length], [6 * length, 4 * length**2]]) / length**3

    def part(element, name, rows=("w1", "theta1")):
        return sp.Matrix(BLOCKS[f"element_{element}"]()[f"constant_{name}"].part(rows, rows).matrix)

    assert part("cubic", "stiffness") == stiffness * bent
    entries = [[156, 22 * length], [22 * length, 4 * length**2]]
    assert part("cubic", "mass") == mass * length * sp.Matrix(entries) / 420
    every = part("timoshenko", "stiffness", ("w1", "theta1", "gamma1", "gamma2"))
    kept, crossed, inner = every[:2, :2], every[:2, 2:], every[2:, 2:]
    phi = 12 * stiffness / (shear * length**2)
    found = sp.simplify(kept - crossed * inner.inv() * crossed.T)
    softened = (
        stiffness
        / ((1 + phi) * length**3)
        * sp.Matrix([[12, 6 * length], [6 * length, (4 + phi) * length**2]])
    )
    assert sp.simplify(found - softened) == sp.zeros(2, 2)
    assert part("rayleigh", "mass", ("w1",))[0].coeff(inertia) == sp.Rational(10, 7) / length


#: Factors of products of the unknowns in D1, D2, D3, D6, (D.17)-(D.19) and (D.22), with the errata, L = 1.
SQUARED = {
    "D1": {"24": -120, "34": -72, "44": -18, "46": 120, "47": -48, "48": 6},
    "D2": {"22": 3600, "33": 1296, "44": 117, "66": 3600, "77": 576, "88": 9, "23": 4320, "24": 1440,
           "26": -7200, "27": 2880, "28": -360, "34": 840, "36": -4320, "37": 1728, "38": -216, "46": -1440,
           "47": 600, "48": -78, "67": -2880, "68": 360, "78": -144},
    "D3": {"22": -21600, "33": -6912, "44": -344, "66": -21600, "77": -4032, "88": -72, "23": -24480,
           "24": -5640, "26": 43200, "27": -18720, "28": 2520, "34": -3144, "36": 24480, "37": -10656,
           "38": 1440, "46": 5640, "47": -2496, "48": 344, "67": 18720, "68": -2520, "78": 1080},
    "D6": {"22": 14400, "33": 3600, "44": 100, "66": 14400, "77": 3600, "88": 100, "23": 14400, "24": 2400,
           "26": -28800, "27": 14400, "28": -2400, "34": 1200, "36": -14400, "37": 7200, "38": -1200,
           "46": -2400, "47": 1200, "48": -200, "67": -14400, "68": 2400, "78": -1200},
}  # fmt: skip


def test_the_strain_energy_is_that_of_the_print():
    """Appendix D: polynomials as printed, and an energy whose second slopes are the stiffness (D.28)."""
    steps = elastic_derivation_system(ELEMENTS["beam8"])
    q = [sp.Symbol(name, real=True) for name in ELEMENTS["beam8"].dofs]
    length, stretch, bend = (sp.Symbol(name, real=True) for name in ("L", "EA", "EI"))
    squares = steps["squared_curvature_of_unknowns"]
    for row, printed in SQUARED.items():
        terms = (k * q[int(i) - 1] * q[int(j) - 1] for (i, j), k in printed.items())
        assert sp.expand(squares.matrix[squares.rows.index(row)].subs(length, 1) - sp.Add(*terms)) == 0, row
    (fourth,) = squares.part(["D4"], []).matrix
    assert sp.expand(fourth).coeff(q[5] * q[7]) == 6240 / length**6
    a1 = -60 * q[1] / length**3 - 36 * q[2] / length**2 - 9 * q[3] / length
    a1 += 60 * q[5] / length**3 - 24 * q[6] / length**2 + 3 * q[7] / length
    assert sp.expand(steps["curvature_coefficients"].matrix[1] - a1) == 0
    assert (steps.expanded("squared_curvature_coefficients") - squares.matrix).expand() == sp.zeros(7, 1)
    energy = steps.expanded("potential_energy")[2]
    printed = derived()["D.28"].xreplace({L: length, EA: stretch, EI: bend})
    assert (sp.hessian(energy, q) - printed).applyfunc(sp.simplify) == sp.zeros(8, 8)


def test_counts():
    """How much was compared, how much differs, how much could not be read."""
    counts: Counter[str] = Counter()
    for name, printed in MATRICES.items():
        for _, read, corrected, _ in entries(name, printed, derived()[name]):
            counts["unreadable" if read is None else "differ" if read != corrected else "agree"] += 1
    for group, errata in ((SHAPES, SHAPE_ERRATA), (PRODUCTS, {}), (MOMENTS, {})):
        for name, text in group.items():
            counts["unreadable" if text == UNREADABLE else "differ" if name in errata else "agree"] += 1
    assert counts == {"agree": 1080, "differ": 16, "unreadable": 86}
    page = (Path(__file__).parents[2] / "docs" / "errata_elastic.md").read_text(encoding="utf-8")
    assert "1080 agree, 16 differ, 86 are" in page


def test_terms_of_the_kinetic_energy():
    """Their sum is the kinetic energy; (A.4)-(A.19) as printed, over half the mass, then rotary inertia."""
    steps = elastic_derivation_system()
    terms, (energy,) = steps["kinetic_terms"], steps["kinetic_energy"].matrix
    assert sp.expand(sum(terms.matrix) - energy) == 0
    printed = """vx^2, vy^2, 2 vy x o, x^2 o^2, 2 vx u_t, u_t^2, -2 o u_t w, -2 w o vx, w^2 o^2, 2 vy u o, 2 vy w_t,
        2 x u o^2, 2 x o w_t, u^2 o^2, 2 u o w_t, w_t^2""".replace("^", "**")
    known = {s.name: s for s in terms.matrix.free_symbols}
    known |= {"o": known["omega"], "vx": known["v_x"], "vy": known["v_y"]}
    for k, text in enumerate(printed.split(",")):
        assert terms.rows[k].split()[0] == f"A.{k + 4}"
        product = sp.sympify("*".join(text.split()), locals=known)
        assert terms.matrix[k] == known["mu"] * product / 2
    assert terms.rows[16:] == ("rotary 1", "rotary 2", "rotary 3")
