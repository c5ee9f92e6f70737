"""Numbers below the least normal double are refused by name: their inverses overflow in the equations."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError


@pytest.mark.parametrize("length", ["1e-310 m", "3e-309 m", "1e-306 mm", "1e309 m", 1e-310])
def test_quantities_fit_in_double_precision(length):
    with pytest.raises(SceneError, match="expected a number that fits in double precision"):
        symgen.build("crank_rocker", set={"links.crank.length": length})
