"""The floating-point types that kernels are made for: one row each, nothing else in symgen knows them."""

from __future__ import annotations

from dataclasses import dataclass, field

from symgen.errors import ModelError, nearest


@dataclass(frozen=True, slots=True, eq=False)
class Precision:
    """A floating-point type of the C compiler.

    Attributes
    ----------
    name
        What users call it.
    c_type, literal_suffix, function_suffix, header, libraries
        How C spells it: the type, what ends its literals and its functions, and where those are.
    size
        Bytes of one number.
    digits
        Significant digits of its literals: enough that the compiler's rounding is the only one.
    greatest
        The largest number; nonzero numbers below its inverse lose digits.
    epsilon
        Distance from 1 to the next larger number; of ``longdouble`` that of x86, see :attr:`dtype`.
    array, dtype
        Type of the numbers in arrays that Python sees, in C and in NumPy.
    low
        Whether such an array keeps only the leading part of a number, so that a second one holds the rest.
    vectors
        Whether compilers have vectors of it, whose lanes evaluate states side by side.
    needs
        Features that a compiler must have in addition to C11.
    """

    name: str
    c_type: str
    size: int
    digits: int
    greatest: str = field(repr=False)  # so that it is no part of the hash of equations
    epsilon: float
    literal_suffix: str
    function_suffix: str
    header: str = "math.h"
    libraries: tuple[str, ...] = ("m",)
    array: str = "double"
    dtype: str = "float64"
    low: bool = False
    vectors: bool = False
    needs: str = ""

    def coarsened(self, tolerance: float) -> float:
        """Return a tolerance that doubles can tell from zero as this type can."""
        return tolerance * max(1.0, self.epsilon / 2.0**-52)


PRECISIONS = {
    p.name: p
    for p in (
        Precision(
            "float32", "float", 4, 17, "3.4028234e38", 2.0**-23, "f", "f", array="float", dtype="float32",
            vectors=True,
        ),
        Precision("float64", "double", 8, 17, "1.7976931348623157e308", 2.0**-52, "", "", vectors=True),
        Precision(
            "longdouble", "long double", 16, 25, "1.18973e4932", 2.0**-63, "L", "l", array="long double",
            dtype="longdouble",
        ),
        Precision(
            "float128", "__float128", 16, 40, "1.18973e4932", 2.0**-112, "Q", "q", "quadmath.h",
            ("quadmath", "m"), low=True, needs="__float128 and libquadmath, as GCC has them",
        ),
    )
}  # fmt: skip

FLOAT64 = PRECISIONS["float64"]


def precision(name: str) -> Precision:
    """Return a precision by name.

    Raises
    ------
    ModelError
        When there is none of that name.
    """
    if not isinstance(name, str) or name not in PRECISIONS:
        raise ModelError(f"there is no precision {name!r}. {nearest(str(name), PRECISIONS)}")
    return PRECISIONS[name]
