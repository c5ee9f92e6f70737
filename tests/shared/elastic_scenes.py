"""Small scenes with elastic links, written out for one test."""

from __future__ import annotations

from pathlib import Path

from symgen import build

#: A bar of steel, 1 m by 20 mm: slender, so that shear and rotary inertia count little.
E, RHO, WIDTH, HEIGHT, LENGTH = 2.1e11, 7850.0, 0.02, 0.02, 1.0
AREA, INERTIA = WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12


def cantilever(
    folder: Path, elastic: str = "", *, speed: str = "0 rad/s", more: str = "", height: str = "20 mm"
):
    """A bar clamped to a shaft that turns or stands still; ``elastic`` and ``more`` are added as written."""
    return _built(
        folder,
        f"""
[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
tip = {{ at = ["1 m", "0 m"] }}

[links.bar]
points = ["O", "tip"]
density = "7850 kg/m^3"
section = {{ width = "20 mm", thickness = "{height}" }}
elastic = {{ E = "210 GPa"{elastic} }}

[crank]
link = "bar"
speed = "{speed}"
{more}
""",
    )


def pinned(folder: Path, elastic: str = "", *, height: str = "20 mm", between: str = ""):
    """A bar pinned to a rigid crank that stands still and to a slider that moves along the bar.

    ``between`` is a further point C of the bar that moves along it as well.
    """
    guided = '["P", "C"]' if between else '["P"]'
    return _built(
        folder,
        f"""
[points]
O = {{ at = ["0 m", "-0.5 m"], ground = true }}
A = {{ at = ["0 m", "0 m"] }}
P = {{ at = ["1 m", "0 m"] }}
R = {{ at = ["0 m", "0 m"], ground = true }}
S = {{ at = ["2 m", "0 m"], ground = true }}
{between}

[links]
rail = {{ points = ["R", "S"] }}

[links.crank]
points = ["O", "A"]
mass_per_length = "1 kg/m"

[links.bar]
points = ["A", "P"]
density = "7850 kg/m^3"
section = {{ width = "20 mm", thickness = "{height}" }}
elastic = {{ E = "210 GPa"{elastic} }}

[[guides]]
points = {guided}
along = "rail"

[crank]
link = "crank"
speed = "0 rad/s"
""",
    )


def _built(folder: Path, text: str):
    file = folder / "scene.toml"
    file.write_text(f'symgen = 1\ntitle = "a bar"\n{text}')
    return build(str(file))


def by_method(model, method, **options):
    """Return a result by an integration method, or of the analysis periodic or quasi-static."""
    if method in ("periodic", "quasi-static"):
        return getattr(model, method.replace("-", "_"))(**options)
    return model.simulate(method=method, **options)
