"""Results in inches and pounds of force, for comparison with references in these units."""

from dataclasses import replace

INCH, POUND = 0.0254, 0.45359237 * 9.80665
SIZES = {
    **dict.fromkeys(("m", "m/s", "m/s^2"), INCH),
    "N": POUND,
    **dict.fromkeys(("N*m", "J", "W"), POUND * INCH),
}


def in_inches(run):
    """The same result with lengths in inches, forces in lbf, moments, energies and powers in lbf*in."""
    return replace(
        run, variables=tuple(replace(v, values=v.values / SIZES.get(v.unit, 1.0)) for v in run.variables)
    )
