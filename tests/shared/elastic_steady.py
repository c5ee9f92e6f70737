"""Steady states of elastic linkages and their derivatives by parameters, from equations independent of symgen.

A clamped strip on a shaft is at rest in its turning axes: (K + K_N - w^2 M) s = Q in 50 digits. The four-bar of
``elastic_reference`` repeats its motion every revolution: its matrices at equal crank angles give one linear system,
which is differentiated implicitly. Tiny imaginary parts of parameters carry derivatives of matrices.
"""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
from shared.elastic_exact import CASES, DIGITS, STEP, structure
from shared.elastic_reference import RIG as PRINTED
from shared.elastic_reference import Elastic

#: The rig of the thesis with the mass of bearings [slug] of the shipped scene.
RIG = replace(PRINTED, bearing=0.0040803133)
#: Imaginary part of a factor of a parameter.
TINY = 1e-30
#: Poses per revolution.
POSES = 301


def of_strip(angle, names):
    """Displacements [m] of the tip of ``rotating_cantilever`` at an angle, and derivatives (2, parameters)."""
    values, _ = CASES["rotating_cantilever"]

    def tip(v):
        made = structure("rotating_cantilever", v, angle / v["speed"], moving=True)
        mass, stiffness = made.matrices()
        load = mp.matrix([made.q.get(name, mp.mpf(0)) for name in made.names])
        found = mp.lu_solve(stiffness - v["speed"] ** 2 * mass, load)
        return [found[made.names.index(axis)] for axis in "xy"]

    with mp.workdps(DIGITS):
        angle = mp.mpf(angle)
        columns = []
        for name in names:
            h = STEP * values[name]
            high, low = (tip(values | {name: values[name] + e}) for e in (h, -h))
            columns.append([float((x - y) / (2 * h)) for x, y in zip(high, low, strict=True)])
        return np.array([float(x) for x in tip(values)]), np.array(columns).T


def changed(name, factor):
    """The rig of the thesis with one parameter of its scene scaled."""
    powers = {
        "a": {"a": 1}, "b": {"b": 1}, "c": {"c": 1}, "frame": {"d": 1}, "speed": {"speed": 1},
        "density": {"m": 1}, "E": {"EI": 1, "EA": 1}, "bearing": {"bearing": 1},
        "width": {"EI": 1, "EA": 1, "m": 1}, "thickness": {"EI": 3, "EA": 1, "m": 1, "half": 1},
    }[name]  # fmt: skip
    return Wide(replace(RIG, **{key: getattr(RIG, key) * factor**n for key, n in powers.items()}))


def slope(of):
    """Derivative at 1 of a function of a factor."""
    return of(1 + 1j * TINY).imag / TINY


class Wide(Elastic):
    """Sums in long double: axial stiffness is a million times that in bending, on axes that turn."""

    def maps(self, motion):
        found = super().maps(motion)
        return found.astype(np.result_type(found, np.longdouble))


def of_four_bar(angles, names):
    """Strains at mid-length of ``thesis_four_bar`` (outputs, angles), and derivatives times the parameters."""
    n, w = POSES, RIG.speed
    numbers = np.arange(n, dtype=np.longdouble)
    pi, apart = np.longdouble("3.14159265358979323846"), numbers[:, None] - numbers
    # Derivatives by the angle of trigonometric polynomials through values at equal angles, and values between.
    with np.errstate(divide="ignore"):
        rate = np.where(apart, (-1) ** apart / (2 * np.sin(pi * apart / n)), 0)
    second = rate @ rate
    poses = (2 * pi * numbers / n).astype(float)
    half = (np.asarray(angles)[:, None] - poses) / 2
    between = np.sin(n * half) / (n * np.sin(half))

    def force(model, s):
        m, c, k, q = model.at(poses)
        parts = ((m, model.bar.speed**2 * (second @ s)), (c, model.bar.speed * (rate @ s)), (k, s))
        return sum(np.einsum("tij,tj->ti", x, y) for x, y in parts) - q

    plain = Wide(RIG)
    m, c, k, _ = (x.astype(float) for x in plain.at(poses))
    system = np.einsum("tij,tl->tilj", m, (w**2 * second).astype(float))
    system += np.einsum("tij,tl->tilj", c, (w * rate).astype(float))
    system[np.arange(n), :, np.arange(n)] += k
    inverse = np.linalg.inv(system.reshape(n * k.shape[1], -1))

    def solved(residual):
        s = np.zeros((n, k.shape[1]), np.longdouble)
        for _ in range(4):
            s = s - (inverse @ residual(s).astype(float).ravel()).reshape(s.shape)
        return s

    def strains(model, s):
        rows = model.strain_rows(angles)
        return np.concatenate([np.einsum("ktn,tn->kt", x, between @ s) for x in rows])

    s = solved(lambda s: force(plain, s))
    load = force(plain, 0 * s)
    slopes = []
    for name in names:
        changes = slope(lambda x, of=name: force(changed(of, x), s))
        moved = solved(lambda ds, changes=changes: force(plain, ds) - load + changes)
        by_rows = slope(lambda x, of=name: strains(changed(of, x), s))
        slopes.append(by_rows + strains(plain, moved))
    return strains(plain, s).astype(float), np.array(slopes, dtype=float)
