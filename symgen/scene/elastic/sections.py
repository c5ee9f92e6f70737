"""Sections of rods: area, second moment and outer fibre along the line, and the mass that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.links import AREA_POWER, INERTIA_POWER, Polynomial
from symgen.scene.elastic.schema import SectionTable
from symgen.scene.reading import Reader
from symgen.scene.schema import Link
from symgen.scene.table import Value
from symgen.scene.units import Dimension

_ZERO = sp.Integer(0)
#: What each kind of section is written by, and the shear factor of the kind: shear energy over that of an
#: even shear stress, of a rectangle and of a circle.
_KINDS: tuple[tuple[tuple[str, ...], sp.Rational | None], ...] = (
    (("width", "thickness"), sp.Rational(5, 6)),
    (("diameter",), sp.Rational(9, 10)),
    (("area", "second_moment", "fibre"), None),
)
_HINT = (
    "Write { width, thickness } of a rectangle, { diameter } of a circle, or { area, second_moment, fibre }."
)


@dataclass(frozen=True, slots=True)
class SectionShape:
    """Area [m^2], second moment [m^4] and outer fibre [m] along a rod, as polynomials in x [m]."""

    area: Polynomial
    second_moment: Polynomial
    fibre: Polynomial
    shear_factor: sp.Expr | None

    @property
    def uniform(self) -> bool:
        """Whether the section is the same all along."""
        return all(c == 0 for p in (self.area, self.second_moment, self.fibre) for c in p[1:])


@dataclass(frozen=True, slots=True)
class LineDensity:
    """Mass [kg/m] and rotary inertia [kg m] per length of a rod of this shape, as polynomials in x [m]."""

    shape: SectionShape
    mass: Polynomial
    rotary: Polynomial


def is_line(link: Link) -> bool:
    """Return whether a link has any key of a section."""
    return any(x is not None for x in (link.density, link.section, link.elastic))


def line(read: Reader, link: Link, length: sp.Expr, where: str, in_space: bool = False) -> LineDensity:
    """Return the properties of a rod along its line; ``in_space`` a rectangle has the direction of its width.

    Raises
    ------
    SceneError
        When section and mass are missing, given twice, or contradict each other.
    """
    for key in ("centre", "inertia"):
        if getattr(link, key) is not None:
            raise SceneError(
                f"the {key} of this link follows from its section",
                where=f"{where}.{key}",
                hint="Leave it out.",
            )
    if len(link.points) > 2:
        raise SceneError(
            "a link with a section is a rod between two points",
            where=f"{where}.points",
            hint='Place further points on it: P = { on = "link", fraction = 0.5 }. '
            "For a point off its centre line, weld a rigid link to it.",
        )
    if link.section is None:
        key = "density" if link.density is not None else "elastic"
        raise SceneError(f"a link with this needs its section: {_NEEDED}", where=f"{where}.{key}", hint=_HINT)
    if link.density is None and link.elastic is None:
        raise SceneError(
            "a section is for links with a density, or elastic ones",
            where=f"{where}.section",
            hint='Write density = "7850 kg/m^3" instead of the mass, or leave the section out.',
        )
    shape = _shape(read, link.section, length, f"{where}.section", in_space)
    mass_keys = [key for key in ("density", "mass", "mass_per_length") if getattr(link, key) is not None]
    if len(mass_keys) != 1:
        problem = f"give one of {', '.join(mass_keys)}, not all" if mass_keys else "this link has no mass"
        raise SceneError(
            problem,
            where=f"{where}.{mass_keys[-1]}" if mass_keys else where,
            hint='Write density = "7850 kg/m^3"; the mass follows from it and the section.',
        )
    return _line(read, link, mass_keys[0], shape, length, where)


_NEEDED = "stiffness and mass follow from it"


def _line(
    read: Reader, link: Link, key: str, shape: SectionShape, length: sp.Expr, where: str
) -> LineDensity:
    dim = {"density": units.DENSITY, "mass": units.MASS, "mass_per_length": units.MASS_PER_LENGTH}[key]
    text = getattr(link, key)
    value = read.not_negative(text, dim, f"{where}.{key}")
    if link.elastic is not None and read.number(value) == 0:
        raise SceneError(
            f"an elastic link needs a mass, got {text!r}",
            where=f"{where}.{key}",
            hint="Without mass its vibrations have no finite frequency. Give it one, or leave elastic out.",
        )
    if key == "density":
        return LineDensity(shape, _times(value, shape.area), _times(value, shape.second_moment))
    if not shape.uniform:
        raise SceneError(
            "a tapered link needs its density: its mass alone does not determine the distribution",
            where=f"{where}.{key}",
            hint='Write density = "7850 kg/m^3" instead.',
        )
    per_length = value / length if key == "mass" else value
    turned = per_length * shape.second_moment[0] / shape.area[0]
    return LineDensity(shape, _padded((per_length,), AREA_POWER), _padded((turned,), INERTIA_POWER))


def rigid(line: LineDensity, length: sp.Expr, rotary: bool) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return mass, centre from the first point, and inertia about the centre of the rod undeformed.

    The inertia is that of its line alone unless its elements have rotary inertia: then a turning link has the
    same kinetic energy by its elements and as a rigid rod.
    """
    mass, first, second = (_moment(line.mass, length, n) for n in range(3))
    if mass == 0:
        return _ZERO, length / 2, _ZERO
    centre = first / mass
    inertia = second - mass * centre**2
    if rotary:
        inertia += _moment(line.rotary, length, 0)
    return mass, centre, inertia


def _moment(density: Polynomial, length: sp.Expr, order: int) -> sp.Expr:
    """Return the integral of the polynomial times s^order over the length."""
    powers = ((k + order + 1, c) for k, c in enumerate(density) if c != 0)
    return sp.Add(*(sp.Mul(sp.Rational(1, n), c, length**n) for n, c in powers))


def _shape(read: Reader, section: SectionTable, length: sp.Expr, where: str, in_space: bool) -> SectionShape:
    """Return the properties of a section of one of the kinds."""
    written = {key for key in section.model_fields_set if getattr(section, key) is not None}
    kind = next(((keys, factor) for keys, factor in _KINDS if written & set(keys)), None)
    if kind is None:
        raise SceneError("this section has no size", where=where, hint=_HINT)
    keys, factor = kind
    placed = {"width_along"} if in_space and "width" in keys else set()
    for key in sorted(written - set(keys) - placed):
        raise SceneError(f"a section by its {keys[0]} has no {key}", where=f"{where}.{key}", hint=_HINT)
    for key in keys:
        if key not in written:
            raise SceneError(f"a section by its {keys[0]} needs this too", where=f"{where}.{key}", hint=_HINT)

    def linear(key: str, dim: Dimension = units.LENGTH) -> Polynomial:
        return _linear(read, getattr(section, key), dim, length, f"{where}.{key}")

    if "diameter" in keys:
        d = linear("diameter")
        area = _times(sp.pi / 4, _product(d, d))
        second = _times(sp.pi / 64, _product(_product(d, d), _product(d, d)))
        fibre = _times(sp.Rational(1, 2), d)
    elif "width" in keys:
        w, h = linear("width"), linear("thickness")
        area = _product(w, h)
        second = _times(sp.Rational(1, 12), _product(area, _product(h, h)))
        fibre = _times(sp.Rational(1, 2), h)
    else:
        area, second = linear("area", units.AREA), linear("second_moment", units.SECOND_MOMENT)
        fibre = linear("fibre")
    return SectionShape(_padded(area, AREA_POWER), _padded(second, INERTIA_POWER), _padded(fibre, 1), factor)


def _linear(
    read: Reader, value: Value | list[Value], dim: Dimension, length: sp.Expr, where: str
) -> Polynomial:
    """Return a size that is uniform, or linear between its values at the two points."""
    if not isinstance(value, list):
        return (read.positive(value, dim, where),)
    if len(value) != 2:
        raise SceneError(
            f"expected one value, or two of a taper: at the first point and at the second, got {len(value)}",
            where=where,
        )
    first, second = (read.positive(v, dim, f"{where}.{i}") for i, v in enumerate(value))
    return (first, (second - first) / length)


def _product(a: Polynomial, b: Polynomial) -> Polynomial:
    product = [_ZERO] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            product[i + k] += x * y
    return tuple(product)


def _times(factor: sp.Expr, polynomial: Polynomial) -> Polynomial:
    return tuple(factor * c for c in polynomial)


def _padded(polynomial: Sequence[sp.Expr], power: int) -> Polynomial:
    return (*polynomial, *[_ZERO] * (power + 1 - len(polynomial)))
