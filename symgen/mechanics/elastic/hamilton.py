"""Hamilton's principle for a moving elastic link, in its fields, before any element is chosen.

Source: the kineto-elasto-dynamics thesis, Chapters VI and VII; the steps carry its equation numbers. Terms
that the thesis omits are marked: rotary inertia and shear (as Timoshenko), the work of the axial force, and
gravity on the displacements.

The link lies along its own x axis, which rotates with ``omega``. ``u`` and ``w`` are small axial and
transverse displacements, ``phi`` the small rotation of the section. The equation is linear in
them: energies are of the second degree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from symgen.symbolic.quantity import Quantity, quantity

THESIS = "thesis on kineto-elasto-dynamics of mechanisms, Chapters VI and VII"

OMEGA = quantity("omega", "rad/s", "angular velocity of the link's axes")
OMEGA_RATE = quantity("omega_rate", "rad/s^2", "angular acceleration of the link's axes")
AX = quantity("ax", "m/s^2", "absolute acceleration of the first point less gravity, along the link")
AY = quantity("ay", "m/s^2", "absolute acceleration of the first point less gravity, across the link")
N0 = quantity("N0", "N", "axial force of the rigid motion at the first point, tension positive")
PX = quantity("p_x", "N", "applied force, component along the link")
PY = quantity("p_y", "N", "applied force, component across the link")
#: Rigid-body motion inputs of a link's equation of motion.
MOTION = (OMEGA, OMEGA_RATE, AX, AY, N0)
APPLIED = (PX, PY)

VX = quantity("v_x", "m/s", "velocity of the first point along the link, x1' of the thesis")
VY = quantity("v_y", "m/s", "velocity of the first point across the link, y1' of the thesis")
GX = quantity("g_x", "m/s^2", "gravity along the link")
GY = quantity("g_y", "m/s^2", "gravity across the link")
PATH = (VX, VY, GX, GY)

X = quantity("x", "m", "distance from the first point of the link")
MU = quantity("mu", "kg/m", "mass per length at x")
ROTARY = quantity("J", "kg*m", "rotary inertia per length at x")
AXIAL = quantity("EA", "N", "axial stiffness at x")
BENDING = quantity("EI", "N*m^2", "bending stiffness at x")
SHEAR = quantity("kGA", "N", "shear stiffness at x")
MASS_BEFORE = quantity("mu_0", "kg", "mass from the first point to x: integral of mu")
MOMENT_BEFORE = quantity("mu_1", "kg*m", "moment of that mass about the first point: integral of mu x")
PROFILE = quantity("p", "1/m", "distribution of the applied force: p p_x and p p_y per length at x")
PROFILE_BEFORE = quantity("p_0", "1", "part of the applied force that acts before x: integral of p")
SECTION = (X, MU, ROTARY, AXIAL, BENDING, SHEAR, MASS_BEFORE, MOMENT_BEFORE, PROFILE, PROFILE_BEFORE)

_KINDS = {"u": ("m", "displacement along the link"), "w": ("m", "displacement across the link")}
_KINDS["phi"] = ("rad", "rotation of the section")
_STRAINS = {
    "u_x": ("1", "axial strain"),
    "phi_x": ("1/m", "curvature"),
    "gamma": ("1", "shear strain w' - phi; zero without shear"),
    "w_x": ("1", "slope of the line of centroids"),
}


_PER = "J/m per unit of row and column"
#: Letters of the thesis for the integrals (A.4)-(A.19) of products of shape functions.
_LETTERS = ("", "", "", "", "E", "B", "A", "G", "M", "E", "G", "N", "L", "B", "A", "M")

#: Erratum of the integrals (A.10) and (A.11).
PLUS = "A.10-A.11 are printed with a plus"


def _fields() -> dict[str, Quantity]:
    """Return the fields with two rates, and their strains, by name."""
    quantities = {}
    for order, word in enumerate(("", "rate of the ", "second rate of the ")):
        for name, (unit, meaning) in _KINDS.items():
            key = name + ("_" + "t" * order if order else "")
            per = (unit, f"{unit}/s", f"{unit}/s^2")[order]
            quantities[key] = quantity(key, per, word + meaning)
    return quantities | {name: quantity(name, unit, text) for name, (unit, text) in _STRAINS.items()}


#: u, w, phi, their rates ``_t`` and ``_tt``, and the strains, as the derivation names them.
FIELDS = _fields()
_F = {name: q.symbol for name, q in FIELDS.items()}
#: Rates of v_x and v_y, which are components in rotating axes and differ from those of the acceleration.
ORIGIN = {
    VX.symbol: AX.symbol + GX.symbol + OMEGA.symbol * VY.symbol,
    VY.symbol: AY.symbol + GY.symbol - OMEGA.symbol * VX.symbol,
}


@dataclass(frozen=True, slots=True)
class HamiltonStep:
    """One step of the derivation: named expressions by rows, with their meaning and source equation."""

    name: str
    rows: tuple[str, ...]
    expressions: tuple[sp.Expr, ...]
    unit: str
    about: str
    source: str
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Term:
    """Term of the equation of a link: integral of density * test^T * trial over x, times a motion factor.

    Attributes
    ----------
    part
        ``inertia``, ``elastic`` or ``geometric``: the energy of its origin; ``follower``, which has none.
    test, trial
        Fields of ``FIELDS`` without rates: of the variation, and of the motion; "" for a load.
    order
        Order of the rate of the trial field.
    motion
        Product of symbols of ``MOTION`` and ``APPLIED``; 1 where it is constant.
    density
        Expression of ``SECTION``.
    """

    part: str
    test: str
    trial: str
    order: int
    motion: sp.Expr
    density: sp.Expr


@dataclass(frozen=True, slots=True)
class Derivation:
    """The steps, and the collected terms of the left-hand side (loads with their sign there)."""

    steps: tuple[HamiltonStep, ...]
    terms: tuple[Term, ...]

    def of(self, part: str, order: int, motion: sp.Expr) -> tuple[Term, ...]:
        """Return the terms of ``part`` with rates of ``order`` and the factor ``motion``."""
        return tuple(
            t for t in self.terms if (t.part, t.order, t.motion) == (part, order, motion) and t.trial
        )

    def loads(self, motion: sp.Expr) -> tuple[Term, ...]:
        """Return the terms without a field that have the factor ``motion``."""
        return tuple(t for t in self.terms if not t.trial and t.motion == motion)


@dataclass(frozen=True, slots=True)
class _Link:
    """Position and velocity of a point of the link, axial force, and energies per length at it."""

    place: tuple[sp.Expr, sp.Expr]
    velocity: tuple[sp.Expr, sp.Expr]
    force: sp.Expr
    kinetic: sp.Expr
    strain: sp.Expr
    stretching: sp.Expr
    gravity: sp.Expr
    applied: sp.Expr
    follower: tuple[sp.Expr, sp.Expr]


@lru_cache(maxsize=1)
def derive() -> Derivation:
    """Derive the weak form of the equation of motion of a link, step by step."""
    link = _link()
    parts = {
        "inertia": _inertia(link),
        "elastic": _slopes(link.strain),
        "geometric": _slopes(link.stretching),
        "follower": dict(zip("uw", (-e for e in link.follower), strict=True)),
    }
    terms = tuple(
        term for part, rows in parts.items() for test, e in rows.items() for term in _collect(part, test, e)
    )
    weak_form: dict[str, sp.Expr] = {}
    for k, e in (row for part in parts.values() for row in part.items()):
        weak_form[k] = weak_form.get(k, sp.Integer(0)) + e
    return Derivation((*_energies(link), *_variation(link, weak_form), *_collected(terms)), terms)


def _slopes(energy: sp.Expr) -> dict[str, sp.Expr]:
    """Return the derivatives of an energy by the fields that it has."""
    return {name: sp.diff(energy, field) for name, field in _F.items() if energy.has(field)}


def _link() -> _Link:
    """Return position, velocity and energies, to the second degree in the fields."""
    omega, mu = OMEGA.symbol, MU.symbol
    place = (X.symbol + _F["u"], _F["w"])
    velocity = (
        VX.symbol + _F["u_t"] - omega * place[1],
        VY.symbol + _F["w_t"] + omega * place[0],
    )
    turning = ROTARY.symbol * (omega + _F["phi_t"]) ** 2 / 2
    stiff = ((AXIAL, "u_x"), (BENDING, "phi_x"), (SHEAR, "gamma"))
    force = _axial_force(velocity)
    return _Link(
        place,
        velocity,
        force,
        kinetic=mu * (velocity[0] ** 2 + velocity[1] ** 2) / 2 + turning,
        strain=sp.Add(*(stiffness.symbol * _F[strain] ** 2 for stiffness, strain in stiff)) / 2,
        stretching=force * _F["w_x"] ** 2 / 2,
        gravity=mu * (GX.symbol * place[0] + GY.symbol * place[1]),
        applied=PROFILE.symbol * (PX.symbol * place[0] + PY.symbol * place[1]),
        follower=(
            -PROFILE.symbol * PY.symbol * _F["phi"],
            PROFILE.symbol * PX.symbol * _F["phi"],
        ),
    )


def _axial_force(velocity: tuple[sp.Expr, sp.Expr]) -> sp.Expr:
    """Return N at x from N' = mu (a_x - g_x) - p p_x, the balance of the rigid motion."""
    rigid = [v.xreplace({symbol: sp.Integer(0) for symbol in _F.values()}) for v in velocity]
    rates = {OMEGA.symbol: OMEGA_RATE.symbol, **ORIGIN}
    moved = sp.Add(*(sp.diff(rigid[0], s) * r for s, r in rates.items()))
    felt = sp.Poly(moved - OMEGA.symbol * rigid[1] - GX.symbol, X.symbol).all_coeffs()
    inertia = [c * q.symbol for c, q in zip(reversed(felt), (MASS_BEFORE, MOMENT_BEFORE), strict=True)]
    return sp.Add(N0.symbol, *inertia, -PX.symbol * PROFILE_BEFORE.symbol)


def _inertia(link: _Link) -> dict[str, sp.Expr]:
    """Return, by field, d/dt of the momentum (by the rates of all variables) minus the force."""
    rates = {_F[k]: _F[f"{k}_t"] for k in _KINDS} | {_F[f"{k}_t"]: _F[f"{k}_tt"] for k in _KINDS}
    rates |= {OMEGA.symbol: OMEGA_RATE.symbol, **ORIGIN}
    forces = {}
    for k in _KINDS:
        momentum = sp.diff(link.kinetic, _F[f"{k}_t"])
        moved = sp.Add(*(sp.diff(momentum, s) * r for s, r in rates.items()))
        forces[k] = sp.expand(moved - sp.diff(link.kinetic + link.gravity + link.applied, _F[k]))
    return forces


def _energies(link: _Link) -> tuple[HamiltonStep, ...]:
    """Return the steps from the position of a point to the energies: Eqs. (6.1)-(6.15)."""
    return (
        HamiltonStep(
            "place", ("x", "y"), link.place, "m", "place of a point in the link's axes", "(6.1)"
        ),
        HamiltonStep(
            "velocity", ("x", "y"), link.velocity, "m/s", "absolute velocity of a point, in the link's axes",
            "(6.10)",
        ),
        HamiltonStep(
            "origin_acceleration", ("x", "y"), tuple(ORIGIN.values()), "m/s^2",
            "derivatives of the components v_x, v_y: not those of the acceleration", "not in the thesis",
        ),
        HamiltonStep(
            "kinetic_energy", ("T",), (link.kinetic,), "J/m", "kinetic energy per length",
            "(6.11), (6.12); rotary inertia added",
        ),
        _kinetic_terms(link),
        HamiltonStep(
            "shear_strain", ("gamma",), (_F["w_x"] - _F["phi"],), "1",
            "shear strain; its variation is that of w' - phi", "not in the thesis",
        ),
        HamiltonStep(
            "strain_energy", ("V",), (link.strain,), "J/m", "strain energy per length",
            "(6.14); shear added",
        ),
        HamiltonStep(
            "axial_force", ("N",), (link.force,), "N",
            "axial force of the rigid motion at x: balance of what lies before", "not in the thesis",
        ),
        HamiltonStep(
            "geometric_energy", ("V_N",), (link.stretching,), "J/m",
            "work of the axial force on the shortening w'^2/2", "not in the thesis",
        ),
        HamiltonStep(
            "gravity_work", ("W",), (link.gravity,), "J/m",
            "work of gravity per length: minus its energy, without a constant",
            "(6.15), with the displacements, which the thesis leaves out; g_x is its -g sin(theta)",
        ),
        HamiltonStep(
            "applied_work", ("W_p",), (link.applied,), "J/m", "work per length of a force along the link",
            "not in the thesis",
        ),
        HamiltonStep(
            "follower_force", ("u", "w"), link.follower, "N/m",
            "change of a force per length that rotates with the section, to first order", "not in the thesis",
        ),
    )  # fmt: skip


def _kinetic_terms(link: _Link) -> HamiltonStep:
    """Return the terms of the kinetic energy in the order of Appendix A, then those of rotary inertia."""
    terms = {t / t.as_coeff_Mul()[0]: t for t in sp.Add.make_args(sp.expand(link.kinetic))}
    x, vx, vy, omega, u, w, u_t, w_t = (
        *(q.symbol for q in (X, VX, VY, OMEGA)), *(_F[name] for name in ("u", "w", "u_t", "w_t")),
    )  # fmt: skip
    products = (
        vx**2, vy**2, vy * omega * x, omega**2 * x**2, vx * u_t, u_t**2, omega * u_t * w, vx * omega * w,
        omega**2 * w**2, vy * omega * u, vy * w_t, omega**2 * x * u, omega * x * w_t, omega**2 * u**2,
        omega * u * w_t, w_t**2,
    )  # fmt: skip
    printed = {f"A.{k}": terms.pop(MU.symbol * product) for k, product in enumerate(products, 4)}
    rows = tuple(f"{row} {letter}".rstrip() for row, letter in zip(printed, _LETTERS, strict=True))
    return HamiltonStep(
        "kinetic_terms",
        (*rows, *(f"rotary {k}" for k in range(1, len(terms) + 1))),
        (*printed.values(), *terms.values()),
        "J/m",
        "terms of the kinetic energy per length; letters are those of the vector or matrix in their "
        "integral, kinetic_integrals",
        "(A.1)-(A.3); A.4, A.8-A.12 add up to (A.1); A.5-A.7, A.13-A.19 add up to (A.2); "
        f"{PLUS}; rotary inertia added",
    )


def _variation(link: _Link, weak_form: Mapping[str, sp.Expr]) -> Iterator[HamiltonStep]:
    """Yield Hamilton's principle: the variation of the energies, and its weak form, Eqs. (7.8)-(7.23)."""
    energy = link.kinetic + link.gravity + link.applied - link.strain - link.stretching
    varied = {name: sp.diff(energy, symbol) for name, symbol in _F.items() if not name.endswith("_tt")}
    yield HamiltonStep(
        "variation", tuple(varied), tuple(varied.values()), _PER,
        "factor of the variation of each field in dT + dW - dV; gravity, axial force, forces along the "
        "link, rotary inertia and shear are added", "(7.8), (7.9)",
    )  # fmt: skip
    yield HamiltonStep(
        "weak_form", tuple(weak_form), tuple(weak_form.values()), _PER,
        "integrated by parts in time: the integral of row * variation is zero", "(7.10)-(7.23)",
    )  # fmt: skip


def _collected(terms: Sequence[Term]) -> Iterator[HamiltonStep]:
    """Yield the factors of second rates, rates and fields, and the loads: Eqs. (7.24)-(7.27)."""
    tests = tuple(dict.fromkeys(t.test for t in terms))
    for name, order, about, source in (
        ("mass_terms", 2, "coefficients of the second rates of the fields", "(7.24)"),
        (
            "gyroscopic_terms",
            1,
            "coefficients of the rates of the fields: -2 omega [AD] per length",
            "(7.25)",
        ),
        ("stiffness_terms", 0, "coefficients of the fields", "(7.26)"),
    ):
        of_order = [t for t in terms if t.trial and t.order == order]
        trials = tuple(name for name in tests if any(t.trial == name for t in of_order))
        entries = tuple(_total(of_order, test, trial) for test in tests for trial in trials)
        yield HamiltonStep(name, tests, entries, _PER, about, source, trials)
    loads = tuple(-_total(terms, test, "") for test in tests)
    yield HamiltonStep(
        "load_terms", tests, loads, _PER, "terms without a field, on the right-hand side", "(7.27)"
    )


def _total(terms: Sequence[Term], test: str, trial: str) -> sp.Expr:
    return sp.Add(*(t.motion * t.density for t in terms if (t.test, t.trial) == (test, trial)))


def _collect(part: str, test: str, expression: sp.Expr) -> list[Term]:
    """Sort a row of the weak form by field, rate and motion: Eqs. (7.24) to (7.27)."""
    fields = [q.symbol for q in FIELDS.values()]
    motion = [q.symbol for q in (*MOTION, *APPLIED)]
    polynomial = sp.Poly(expression, *fields, *motion)
    terms = []
    for powers, density in polynomial.terms():
        names = [name for name, p in zip(FIELDS, powers, strict=False) if p]
        factor = sp.Mul(*(s**p for s, p in zip(motion, powers[len(fields) :], strict=True)))
        if density == 0:
            continue
        trial, order = names[0] if names else "", 0
        if trial.endswith(("_t", "_tt")):
            trial, _, ts = trial.rpartition("_")
            order = len(ts)
        terms.append(Term(part, test, trial, order, factor, density))
    return terms
