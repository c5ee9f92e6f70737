"""Numbers below the least normal double are refused by name: their inverses overflow in the equations."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError


@pytest.mark.parametrize("length", ["1e-310 m", "3e-309 m", "1e-306 mm", "1e309 m", 1e-310])
def test_quantities_fit_in_double_precision(length):
    with pytest.raises(SceneError, match="expected a number that fits in double precision"):
        symgen.build("crank_rocker", set={"links.crank.length": length})


@pytest.mark.parametrize(
    ("key", "value", "constant"),
    [
        ("length", "1e200 m", "5.0e+399"),  # half of its square
        ("length", "1e-170 m", "5.0e-341"),
        ("mass", "1e308 kg", "-4.90e+308"),  # the weight of half of it
    ],
)
@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_products_beyond_the_range_name_the_quantity(key, value, constant, backend):
    """Literals were printed as inf, or as zero."""
    with pytest.raises(SceneError) as raised:
        symgen.build("four_bar", set={f"links.crank.{key}": value}, backend=backend)
    assert str(raised.value) == (
        f"four_bar.toml: [links.crank] {key}: {value} is too large or too small next to the other quantities: the "
        f"equations have the constant {constant}, which is beyond the range of float64"
    )
