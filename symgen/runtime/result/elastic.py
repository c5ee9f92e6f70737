"""What a run of elastic links gives: strains, displacements and lengths over the crank angle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import ModelError, nearest
from symgen.runtime.beams.frames import frames
from symgen.runtime.result.result import Result, Variable

if TYPE_CHECKING:
    from symgen.runtime.beams.links import Beam
    from symgen.runtime.elastic.motion import ElasticMotion

Array = NDArray[np.float64]

#: The error of the largest Floquet multiplier, as a part of it, from which on it says nothing of stability.
FLOQUET_SETTLED = 1e-3
#: By how much a multiplier may pass one before a steady state counts as unstable.
_ROUND_OFF = 1e-6


@checked
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
        """Largest absolute value of every output of one component, in its unit.

        Between equally spaced times it is that of the parabola through the largest value and its neighbours.
        """
        even = len(self.time) > 2 and bool(np.allclose(np.diff(self.time), self.time[1] - self.time[0]))
        return {
            v.name: _between(np.abs(v.values)) if even else float(np.max(np.abs(v.values)))
            for v in self.variables
            if v.values.ndim == 1
        }

    @property
    def floquet(self) -> tuple[complex, ...]:
        """Floquet multipliers of one turn, the largest first; empty where they were not asked for."""
        return tuple(complex(re, im) for re, im in self.statistics["floquet"])

    @property
    def stable(self) -> bool | None:
        """Whether the steady state is stable; None where its multipliers do not tell, or there are none."""
        return is_stable(abs(self.floquet[0]), self.statistics["floquet_error"]) if self.floquet else None

    def estimate_later(self, estimate: Callable[[], float | None]) -> None:
        """Set how :attr:`mesh_error` is computed when it is requested."""
        self._cache["estimate"] = estimate

    @property
    def mesh_error(self) -> float | None:
        """Largest change of stresses over their peak when every element is halved; None where unknown.

        The first request, which printing and saving make, repeats the run with halved elements.
        """
        if "mesh_error" not in self._cache:
            estimate = self._cache.pop("estimate", None)
            self._cache["mesh_error"] = estimate() if estimate else self.statistics.get("mesh_error")
        return self._cache["mesh_error"]

    def all_statistics(self) -> dict[str, Any]:
        """Return the statistics with those that are computed when they are requested."""
        return {**self.statistics, "mesh_error": self.mesh_error}

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "statistics": self.all_statistics()}

    @property
    def headline(self) -> str:
        """What a plot says of the run."""
        known = [
            f"{error:.1e} by {what}"
            for what, error in (
                ("time steps", self.statistics["error"]),
                ("elements", self.mesh_error),
            )
            if error is not None
        ]
        errors = f", estimated errors of the peak stress: {', '.join(known)}" if known else ""
        return f"{self.provenance['method']}, {self.statistics['steps']} steps{errors}"

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
            "damping_ratios": self.statistics.get("damping_ratios", []),
            "mean_powers_w": self.statistics.get("mean_powers_w", []),
            "mesh_error_over_peak": self.mesh_error,
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


def _between(values: Array) -> float:
    """Return the largest of the parabola through the largest of equally spaced values and its neighbours."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    before, here, after = (float(x) for x in values[k - 1 : k + 2])
    bend = 2 * here - before - after
    return here + (after - before) ** 2 / (8 * bend) if bend > 0.0 else here


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
        Motion of the links, (times, links, columns).
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


def selected(variables: Sequence[Variable], motion: ElasticMotion) -> tuple[Variable, ...]:
    """Return the outputs that the scene selects, in its order; all where it selects none.

    Raises
    ------
    ModelError
        When a run of elastic links has no such output.
    """
    names = motion.info.outputs
    if names is None:
        return tuple(variables)
    known = {v.name: v for v in variables}
    for name in names:
        if name not in known:
            raise ModelError(
                f"{motion.rigid.name}: analysis.outputs names {name!r}, which runs of elastic links do not "
                f"have. {nearest(name, known)}"
            )
    return tuple(known[name] for name in names)


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
    axes = frames(links[:, k])
    for u, w in motion.beams[k].ends:
        found[:, u], found[:, w] = axes.local(found[:, u].copy(), found[:, w].copy())
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
