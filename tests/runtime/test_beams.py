"""Elastic links as superelements, against closed forms and an independent quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from beam_reference import DOFS, Reference

from symgen.runtime import beam_elements
from symgen.runtime.beam_pieces import whole
from symgen.runtime.beams import BeamInfo, Properties, beam


@pytest.fixture(autouse=True)
def reference(monkeypatch):
    monkeypatch.setattr(beam_elements, "kernels", Reference)


def info(element="beam8", elements=1, **more):
    node, inner = DOFS[element]
    return BeamInfo("arm", "O", "A", element, node, inner, elements, **more)


UNIFORM = Properties(
    length=1.3,
    mass=(0.7, 0.0, 0.0),
    rotary=(0.0,) * 5,
    axial=(4e5, 0.0, 0.0),
    bending=(11.0, 0.0, 0.0, 0.0, 0.0),
    shear=(2e5, 0.0, 0.0),
    fibre=(0.002, 0.0),
    modulus=7e10,
)


def frequencies(b, held):
    from scipy.linalg import eigh

    n = len(b.dofs)
    p = whole(b.pieces, n)
    free = [i for i in range(n) if b.dofs[i] not in held and i not in b.fixed]
    at = np.ix_(free, free)
    return np.sqrt(np.abs(eigh(p.stiffness[at], p.mass[at], eigvals_only=True)))


#: Relative errors of f1 and f2 as the method prints them.
GOLDEN = {1: ("7.1475e-04", "8.133e-03"), 2: ("1.01e-06", "7.15e-04"), 3: ("3e-08", "1.2e-05")}


@pytest.mark.parametrize("elements", GOLDEN)
def test_pinned_pinned_by_the_golden_file(elements):
    b = beam(info(elements=elements), UNIFORM)
    found = frequencies(b, {"w@0", f"w@{elements}"} | {d for d in b.dofs if d[0] == "u"})[:2]
    exact = np.array([np.pi, 2 * np.pi]) ** 2 * np.sqrt(11.0 / 0.7) / 1.3**2
    errors = found / exact - 1
    for error, golden in zip(errors, GOLDEN[elements], strict=True):
        digits = max(len(golden) - 6, 0)
        assert f"{error:.{digits}e}" == golden
