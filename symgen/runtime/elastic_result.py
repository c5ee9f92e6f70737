"""What a run of elastic links gives: strains, displacements and lengths over the crank angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.result import Result, Variable

if TYPE_CHECKING:
    from symgen.runtime.beams import Beam
    from symgen.runtime.elastic_motion import ElasticMotion

Array = NDArray[np.float64]

#: The error of the largest Floquet multiplier, as a part of it, from which on it says nothing of stability.
FLOQUET_SETTLED = 1e-3
#: By how much a multiplier may pass one before a steady state counts as unstable.
_ROUND_OFF = 1e-6


class ElasticResult(Result):
    """A run of a linkage with elastic links; ``result["coupler.bending_strain"]`` is an array over time."""

    @property
    def angles(self) -> Array:
        """Direction of the crank at each time [deg], counted on over turns."""
        return np.array(self.statistics["angle_deg"])

    @property
    def over(self) -> tuple[Array, str]:
        """What plots have along their axis, and what it is called."""
        if not self.statistics["turns"]:
            return self.time, "time [s]"
        return self.angles, "crank angle [deg]"

    def panel(self, variable: Variable) -> str:
        """Return the panel of a plot that an output is drawn in: positions dwarf displacements."""
        return panel_by_kind(variable)

    @property
    def peaks(self) -> dict[str, float]:
        """Largest absolute value of every output of one component, in its unit."""
        return {v.name: float(np.max(np.abs(v.values))) for v in self.variables if v.values.ndim == 1}

    @property
    def floquet(self) -> tuple[complex, ...]:
        """Floquet multipliers of one turn, the largest first; empty where they were not asked for."""
        return tuple(complex(re, im) for re, im in self.statistics["floquet"])

    @property
    def stable(self) -> bool | None:
        """Whether the steady state is stable; None where its multipliers do not tell, or there are none."""
        return is_stable(abs(self.floquet[0]), self.statistics["floquet_error"]) if self.floquet else None

    @property
    def headline(self) -> str:
        """What a plot says of the run."""
        error = self.statistics["error"]
        known = f", estimated error {error:.1e} of the peak stress" if error is not None else ""
        return f"{self.provenance['method']}, {self.statistics['steps']} steps{known}"

    def summary(self) -> dict[str, Any]:
        """Return the run in plain numbers: what ``symgen run --json`` prints."""
        columns = [
            (f"{v.name}.{c}" if c else v.name, v.unit, v.values.reshape(len(self.time), -1)[:, i])
            for v in self.variables
            for i, c in enumerate(v.components or ("",))
        ]
        multipliers = [[z.real, z.imag] for z in self.floquet]
        return {
            "scene": self.name,
            "method": self.provenance["method"],
            "form": self.provenance["form"],
            "unknowns": self.statistics["unknowns"],
            "steps": self.statistics["steps"],
            "error_over_peak": self.statistics["error"],
            "wall_s": self.statistics["wall_s"],
            "backend": self.provenance["backend"],
            "equations": self.provenance["equations"],
            "parameters": dict(self.provenance["parameters"]),
            "units": {name: unit for name, unit, _ in columns},
            "peaks": self.peaks,
            "floquet": multipliers,
            "floquet_max": abs(self.floquet[0]) if multipliers else None,
            "floquet_error": self.statistics["floquet_error"],
            "stable": self.stable,
            "notes": list(self.notes),
            "values": [
                {"angle_deg": float(angle), "t": float(t), **{n: float(x[i]) for n, _, x in columns}}
                for i, (angle, t) in enumerate(zip(self.angles, self.time, strict=True))
            ],
        }


def panel_by_kind(variable: Variable) -> str:
    """Return a panel for outputs of the same kind: the last word of their name, with its unit."""
    kind = variable.name.rpartition(".")[2].replace("_", " ")
    return kind if variable.unit == "1" else f"{kind} [{variable.unit}]"


def is_stable(largest: float, error: float | None) -> bool | None:
    """Tell from the largest Floquet multiplier and how far off it is whether a steady state is stable.

    None where it is not known well enough to tell.
    """
    if error is None or not error <= FLOQUET_SETTLED * largest:
        return None
    return largest <= 1.0 + _ROUND_OFF + error


def outputs(motion: ElasticMotion, links: Array, displacements: Array) -> list[Variable]:
    """Return strains at the stations, displacements of joints and changes of length.

    Parameters
    ----------
    links
        Motion of the links, (times, links, 10).
    displacements
        (times, unknowns).
    """
    found = []
    own = [own_unknowns(motion, k, links, displacements) for k in range(len(motion.beams))]
    for name, k, at, fibre in motion.stations:
        beam = motion.beams[k]
        rows = beam.rows(at)
        bending, axial = own[k] @ rows.curvature * fibre, own[k] @ rows.axial_strain
        found += strains(name, beam, at, bending, axial)
    names = motion.layout.names
    for point in motion.rigid.description.free:
        columns = [names.index(f"{point}.{axis}") for axis in "xy"]
        found.append(displacement(point, displacements[:, columns]))
    found += [length_change(b.info.link, _stretch(b, own[k])) for k, b in enumerate(motion.beams)]
    return found


def strains(name: str, beam: Beam, at: float, bending: Array, axial: Array) -> list[Variable]:
    """Return the outputs of a station at a share of a link's length, from its strains over time."""
    where = f"{beam.info.link}, at {at:g} of its length"
    stress = beam.properties.modulus * (bending + axial)
    return [
        Variable(f"{name}.bending_strain", "1", f"bending strain in the fibre of {where}", (), bending),
        Variable(f"{name}.axial_strain", "1", f"axial strain of {where}", (), axial),
        Variable(f"{name}.stress", "Pa", f"stress in the fibre of {where}", (), stress),
    ]


def displacement(point: str, values: Array) -> Variable:
    """Return the output of a point's displacement [m], (times, 2)."""
    about = f"displacement of {point} from the rigid motion"
    return Variable(f"{point}.displacement", "m", about, ("x", "y"), values)


def length_change(link: str, values: Array) -> Variable:
    """Return the output of the change of the distance between the ends of a link [m]."""
    about = f"change of the distance between the ends of {link}"
    return Variable(f"{link}.length_change", "m", about, (), values)


def own_unknowns(motion: ElasticMotion, k: int, links: Array, displacements: Array) -> Array:
    """Return the unknowns of a link in its own axes, (times, n)."""
    places = motion.layout.of_links[k]
    padded = np.column_stack([displacements, np.zeros(len(displacements))])
    found = padded[:, places]
    d = links[:, k, :2] / np.linalg.norm(links[:, k, :2], axis=1)[:, None]
    for u, w in motion.beams[k].ends:
        x, y = found[:, u].copy(), found[:, w].copy()
        found[:, u], found[:, w] = d[:, 0] * x + d[:, 1] * y, d[:, 0] * y - d[:, 1] * x
    return found


def _stretch(beam: Beam, own: Array) -> Array:
    """Return the change of the distance between the ends [m], to the second order of bending.

    What the axial strain adds, less the half of the integral of the square of the slope from the line between
    the ends. Turning the link as a whole changes nothing, however far linear displacements go.
    """
    (u0, w0), (u1, w1) = beam.ends
    turned = (own[:, w1] - own[:, w0]) / beam.properties.length
    whole = own if beam.expansion is None else own @ beam.expansion.T
    shortened = -beam.properties.length * turned**2
    for part in beam.segments:
        here = whole[:, list(part.dofs)]
        shortened += np.einsum("ti,ij,tj->t", here, part.matrix("geometric", 3)[0], here)
    found: Array = own[:, u1] - own[:, u0] - shortened / 2
    return found
