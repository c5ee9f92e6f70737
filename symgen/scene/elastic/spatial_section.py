"""Sections of elastic links in space: stiffness against bending in two planes, and torsion."""

from __future__ import annotations

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.schema import ElasticTable, Shear
from symgen.scene.elastic.sections import line
from symgen.scene.reading import Reader
from symgen.symbolic.switch import greatest, least

#: Terms of the series of the torsion of a rectangle.
_TERMS = 6


def shear_modulus(read: Reader, shear: Shear, modulus: sp.Expr, where: str) -> sp.Expr:
    """Return the shear modulus [Pa]; ``modulus`` is Young's."""
    if (shear.modulus is None) == (shear.poisson is None):
        raise SceneError("give modulus or poisson, one of them", where=where)
    if shear.modulus is not None:
        return read.positive(shear.modulus, units.PRESSURE, f"{where}.modulus")
    ratio = read.value(shear.poisson or 0, units.NUMBER, f"{where}.poisson")
    if not -1 < read.number(ratio) <= 0.5:
        raise SceneError(
            f"expected a Poisson's ratio above -1 and up to 0.5, got {shear.poisson!r}",
            where=f"{where}.poisson",
        )
    shear_of = modulus / (2 * (1 + ratio))
    read.limit(shear_of, units.PRESSURE, f"{where}.poisson, modulus", strict=True)
    return shear_of


def section_in_space(
    read: Reader, name: str, elastic: ElasticTable, length: sp.Expr, where: str
) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
    """Return the direction of the width, and mu, J_y, J_z, EA, EI_y, EI_z, GJ."""
    link = read.scene.links[name]
    along = line(read, link, length, where, in_space=True)
    shape, section, here = along.shape, link.section, f"{where}.section"
    for key, size in section or ():
        if isinstance(size, list) and key != "width_along":
            raise SceneError(
                f"an elastic link in space is uniform along its length: expected one value, got {size}",
                where=f"{here}.{key}",
                hint="Write one value; divide a tapered link into uniform ones.",
            )
    if elastic.shear is None or elastic.shear.factor is not None:
        raise SceneError(
            "an elastic link in space needs the shear modulus for its torsion, and no shear factor",
            where=f"{where}.elastic.shear",
            hint='Write shear = { poisson = 0.3 }, or shear = { modulus = "80 GPa" }.',
        )
    modulus = read.positive(elastic.E, units.PRESSURE, f"{where}.elastic.E")
    shear = shear_modulus(read, elastic.shear, modulus, f"{where}.elastic.shear")
    area, about_y = shape.area[0], shape.second_moment[0]
    mu, round_ = along.mass[0], section is not None and section.diameter is not None
    if section is None or section.width_along is None:
        if not round_:
            raise SceneError(
                "expected a circle, or a rectangle with the direction of its width in space",
                where=here,
                hint="Write { width, thickness, width_along = [0, 1, 0] }, or { diameter }.",
            )
        drawn = [read.number(c) for c in read.drawn(name)]
        about_z, torsion, width = about_y, 2 * about_y, _any_across(drawn)
    else:
        width = read.vector(section.width_along, units.NUMBER, f"{here}.width_along")
        wide = read.positive(section.width, units.LENGTH, f"{here}.width")  # type: ignore[arg-type]
        about_z = area * wide**2 / 12
        torsion = torsion_constant(wide, area / wide)
        if read.is_along(name, width):
            raise SceneError(
                "expected a direction across the link, got one along it, or zero", where=f"{here}.width_along"
            )
    density = mu / area
    return width, (
        mu,
        density * about_y,
        density * about_z,
        modulus * area,
        modulus * about_y,
        modulus * about_z,
        shear * torsion,
    )


def torsion_constant(width: sp.Expr, thickness: sp.Expr) -> sp.Expr:
    """Return Saint-Venant's torsion constant [m^4] of a rectangle.

    a b^3 [1/3 - 64/pi^5 (b/a) sum of tanh(n pi a/(2 b))/n^5 over odd n], a >= b: S. P. Timoshenko,
    J. N. Goodier, Theory of Elasticity, Art. 109. The sum is 31 zeta(5)/32 less terms that fall
    exponentially. Parameters may make either side the longer one.
    """
    a, b = greatest(width, thickness), least(width, thickness)
    less = sp.Add(*(2 / ((sp.exp(n * sp.pi * a / b) + 1) * n**5) for n in range(1, 2 * _TERMS, 2)))
    zeta = sp.Rational(31, 32) * sp.Float("1.03692775514336992633136548645703416805708092", 40)
    return a * b**3 * (sp.Rational(1, 3) - 64 / sp.pi**5 * b / a * (zeta - less))


def _any_across(drawn: list[float]) -> tuple[sp.Expr, ...]:
    """Return the axis of coordinates most across the link: a round section has no direction of its own."""
    sizes = [abs(c) for c in drawn]
    least = sizes.index(min(sizes))
    return tuple(sp.Integer(int(k == least)) for k in range(3))
