"""Elastic links in the plane as rigid rods with torsion springs between them: a plain scene for the rods method.

It is independent of all beam elements. A link of length l becomes n rods. Where it is free to turn at both ends
they are equal, h = l/n, and a rod stands for the direction at its middle. Where its first end is clamped to the
shaft, its first rod is half a rod and stands for the direction of the shaft, so h = l/(n - 1/2). Either way h lies
between the places of neighbouring directions, their difference over h is the curvature at the joint between the
rods, and the spring there has the stiffness E I/h: a central difference, with an error that falls as h^2. The rods
keep their lengths and do not shear. Points, loads and masses on elastic links are those at their ends.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

import symgen
from symgen.scene.resolve import resolve


@dataclass(frozen=True)
class Rods:
    """A linkage with elastic links in rods.

    ``rods`` are the names of the rods of each elastic link, ``nodes`` where they meet, as fractions of its length,
    ``fibres`` the distances of the outer fibre at mid-length [m].
    """

    model: Any
    rods: Mapping[str, Sequence[str]]
    nodes: Mapping[str, np.ndarray]
    lengths: Mapping[str, float]
    fibres: Mapping[str, float]
    rigid: Any

    def simulate(self, t_end: float, samples: int, rtol: float = 1e-7):
        """Return a run from straight links that move as rigid ones."""
        start, names = self.rigid.initial_state(), self.model.description.free
        places, velocities = dict(start.positions), dict(start.velocities)
        for link, rods in self.rods.items():
            first, *_, last = (self.model.description.links[rod] for rod in (*rods, rods[-1]))
            for rod, share in zip(rods[:-1], self.nodes[link][1:-1], strict=True):
                point = self.model.description.links[rod][1]
                for kind in (places, velocities):
                    kind[point] = (1 - share) * kind[first[0]] + share * kind[last[1]]
        state = self.model.state({p: places[p] for p in names}, {p: velocities[p] for p in names})
        return self.model.simulate(t_end, samples=samples, method="dop853", rtol=rtol, state=state)

    def bending_strain(self, run, link: str) -> np.ndarray:
        """Return the bending strain at mid-length, linear between the joints of the rods."""
        angles = np.stack([run[f"{rod}.angle"].values for rod in self.rods[link]], axis=1)
        nodes = self.nodes[link]
        turned = np.diff(angles, axis=1)
        turned -= math.tau * np.round(turned / math.tau)
        bent = turned / ((nodes[-1] - nodes[-2]) * self.lengths[link])
        k = int(np.searchsorted(nodes, 0.5))
        part = (0.5 - nodes[k - 1]) / (nodes[k] - nodes[k - 1])
        return self.fibres[link] * ((1 - part) * bent[:, k - 2] + part * bent[:, k - 1])


def _quantity(value: float, unit: str) -> str:
    return f"{float(value)!r} {unit}"


def in_rods(scene: Mapping[str, Any], count: int) -> Rods:
    """Return the linkage of the tables of a scene with its elastic links in ``count`` rods each."""
    elastic, data = symgen.build(symgen.Scene(**scene)), copy.deepcopy(dict(scene))
    linkage = resolve(symgen.Scene(**scene))
    places, crank = dict(elastic.rigid.initial_state().positions), dict(data.pop("crank"))
    mode, links = crank.get("mode", "held"), {e.link: e for e in linkage.elastic}
    names, nodes, lengths, fibres = dict[str, list[str]](), dict[str, np.ndarray](), dict[str, float](), {}
    springs, value = list(data.get("torsion_springs", ())), lambda x: float(linkage.number(x))
    parameters = data.setdefault("parameters", {})
    for name, beam in links.items():
        link = linkage.link(name)
        length = value(link.length)
        clamped = crank["link"] == name and mode != "free"
        h = 1 / (count - 0.5) if clamped else 1 / count
        at = np.concatenate([[0.0], (h / 2 if clamped else h) + h * np.arange(count)])
        rods = [f"{name}_{k}" for k in range(1, count + 1)]
        points = [link.start, *(f"{name}_p{k}" for k in range(1, count)), link.end]
        first, last = places[link.start], places[link.end]
        for point, share in zip(points[1:-1], at[1:-1], strict=True):
            places[point] = (1 - share) * first + share * last
        del data["links"][name]
        per_length, rotary, bending, fibre = (
            np.polynomial.Polynomial([value(c) for c in of])
            for of in (beam.section.mass, beam.section.rotary, beam.section.bending, beam.section.fibre)
        )
        moments = [(per_length * np.polynomial.Polynomial([0.0, 1.0]) ** k).integ() for k in range(3)]
        turning = rotary.integ()
        for k, (low, high) in enumerate(pairwise((at * length).tolist())):
            mass, moment, second = (m(high) - m(low) for m in moments)
            inertia = second - moment**2 / mass + turning(high) - turning(low)
            if clamped and k == 0 and linkage.crank is not None:
                inertia += value(linkage.crank.flywheel)
            data["links"][rods[k]] = {
                "points": points[k : k + 2],
                "mass": _quantity(mass, "kg"),
                "centre": float((moment / mass - low) / (high - low)),
                "inertia": _quantity(inertia, "kg*m^2"),
            }
        damping = value(beam.stiffness_damping)
        for before, after, share in zip(rods[:-1], rods[1:], at[1:-1].tolist(), strict=True):
            stiffness = bending(share * length) / (h * length)
            spring = {"link": after, "against": before, "stiffness": _quantity(stiffness, "N*m")}
            springs.append(spring | {"damping": _quantity(damping * stiffness, "N*m*s")})
        names[name], nodes[name], lengths[name], fibres[name] = rods, at, length, float(fibre(length / 2))
    for point in places.keys() - set(elastic.rigid.description.ground):
        data["points"][point] = {"at": [_quantity(x, "m") for x in places[point]]}
    owner = names.get(crank["link"], [crank["link"]])[0]
    if mode == "motor":
        data["torques"] = [*data.get("torques", ()), {"link": owner, "torque": crank["torque"]}]
    if mode == "held":
        shaft = linkage.link(crank["link"])
        a, b = places[shaft.start], places[shaft.end]
        parameters |= {
            "crank__angle": _quantity(math.atan2(b[1] - a[1], b[0] - a[0]), "rad"),
            "crank__speed": crank["speed"],
        }
        data["drivers"] = [
            *data.get("drivers", ()),
            {"link": owner, "angle": "crank__angle + crank__speed*t"},
        ]
    for load in data.get("forces", ()):
        if load.get("link") in names:  # one that rotates with the last section
            load["link"] = names[load["link"]][-1]
    data["torsion_springs"] = springs
    outputs = [f"{rod}.angle" for rods in names.values() for rod in rods]
    data["analysis"] = {"outputs": [*outputs, *(f"{p}.position" for p in elastic.rigid.description.points)]}
    for table in ("stations", "units", "modal_damping"):
        data.pop(table, None)
    return Rods(symgen.build(symgen.Scene(**data)), names, nodes, lengths, fibres, elastic.rigid)
