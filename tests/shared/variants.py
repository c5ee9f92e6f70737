"""The shipped crank-rocker with tunable lengths, and its pose by two circles."""

from __future__ import annotations

import numpy as np

from symgen.scene.loading import SHIPPED

BASE = 0.4


def crank_rocker_with_lengths(folder):
    """Write the scene with the tunable lengths a, b and c [m] of crank, coupler and rocker; return its path."""
    text = (SHIPPED / "crank_rocker.toml").read_text(encoding="utf-8")
    for name, length in (("a", "10 cm"), ("b", "35 cm"), ("c", "30 cm")):
        text = text.replace(f'length = "{length}"', f'length = "{name}"')
        text = text.replace("[points]", f'{name} = {{ value = "{length}", tunable = true }}\n\n[points]', 1)
    path = folder / "variants.toml"
    path.write_text(text, encoding="utf-8")
    return path


def pins(a, b, c, angle):
    """Return the places of A and B [m] at angles of the crank: circles about A and C meet above the line AC."""
    at = a * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    d = np.array([BASE, 0.0]) - at
    far = np.hypot(d[..., 0], d[..., 1])[..., None]
    along = (b**2 - c**2 + far**2) / (2 * far)
    normal = np.stack([-d[..., 1], d[..., 0]], axis=-1)
    return at, at + (d * along + normal * np.sqrt(b**2 - along**2)) / far
