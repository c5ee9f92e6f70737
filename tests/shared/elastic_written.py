"""Transformations of scenes with elastic links: those of ``transformed``, and what only elastic links have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from shared import transformed
from shared.transformed import WORDS, Tables, Transformed, number_of


def written(of: str, tables: Tables, rng: np.random.Generator) -> tuple[Tables, Transformed]:
    """Return the scene transformed by one of ``transformed.TRANSFORMATIONS``."""
    made, by = transformed.TRANSFORMATIONS[of](tables, rng)
    if of in ("turned", "mirrored"):
        _turn(made, by)
    if of == "reordered":
        backward = {link for link, angle in by.directions.items() if angle == math.pi}
        _reverse(made, backward)
        by = replace(
            by, flipped=frozenset(s["name"] for s in made.get("stations", ()) if s["link"] in backward)
        )
    if len(by.turn) == 3:
        backward = frozenset(link for link, angle in by.directions.items() if angle == math.pi)
        owners = {s["name"]: s["link"] for s in tables.get("stations", ())}
        by = InSpace(**{f.name: getattr(by, f.name) for f in fields(by)}, owners=owners, backward=backward)
    return made, by


@dataclass(frozen=True)
class InSpace(Transformed):
    """In space: moments and fibres are on the axes of a link along its line, its width and across both.

    ``owners`` are the links of stations, ``backward`` the links whose ends were exchanged.
    """

    owners: Mapping[str, str] = field(default_factory=dict)
    backward: frozenset[str] = frozenset()

    def output(self, name: str, values: np.ndarray) -> np.ndarray:
        owner, _, word = name.rpartition(".")
        link = self.owners.get(owner, owner.partition(".")[0])
        sign, along = self.sign, -1.0 if link in self.backward else 1.0
        values = np.asarray(values) * self.scale(WORDS[word][0])
        if word in ("moment_y", "bending_strain_y"):
            return values * sign * along
        if word == "torque":
            return values * (sign if owner in self.owners else 1.0)
        if word == "moment":
            return values if values.shape[-1] == 2 else values * [sign * along, sign, along]
        if word == "deflection":
            return values @ self.turn.T
        return super().output(name, values / self.scale(WORDS[word][0]))


def _turn(made: Tables, by: Transformed) -> None:
    plane = len(by.turn) == 2
    for load in made.get("distributed_forces", ()):
        for key in ("force", "end"):
            turn = by.turn if load["axes"] == "fixed" else np.diag([1.0, by.sign])
            values = turn @ [number_of(x)[0] for x in load[key]]
            load[key] = transformed.texts(values, "N/m")
    for station in made.get("stations", ()):
        if "fibre" in station:
            station["fibre"] = transformed.affine(station["fibre"], by.sign, 0.0)
    for joint in made.get("joints", ()):
        joint["axis"] = (by.sign * by.turn @ joint["axis"]).tolist()
    crank = made.get("crank", {})
    if "angle" in crank:
        crank["angle"] = transformed.affine(crank["angle"], by.sign, by.rotation)
    if "speed" in crank:
        crank["speed"] = transformed.affine(crank["speed"], by.sign, 0.0)
    if "torque" in crank and plane:
        rate = f"({by.sign!r}*this.rate)"
        crank["torque"] = transformed.affine(crank["torque"].replace("this.rate", rate), by.sign, 0.0)


def _reverse(made: Tables, backward: set[str]) -> None:
    """Change what the direction of a link decides."""
    for name in backward & set(made["links"]):
        section = made["links"][name].get("section", {})
        for value in section.values():
            if isinstance(value, list) and isinstance(value[0], str):
                value.reverse()
    for load in made.get("distributed_forces", ()):
        if load["link"] in backward:
            load["force"], load["end"] = load["end"], load["force"]
            if load["axes"] != "fixed":
                for key in ("force", "end"):
                    load[key] = [transformed.affine(x, -1.0, 0.0) for x in load[key]]
    for station in made.get("stations", ()):
        if station["link"] in backward:
            station["at"] = 1 - station["at"]
            if "fibre" in station:
                station["fibre"] = transformed.affine(station["fibre"], -1.0, 0.0)
