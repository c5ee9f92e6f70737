"""Results of scenes with elastic links, for comparison with those of the same scene written differently."""

from __future__ import annotations

import math

import numpy as np
from shared.invariances import Results
from shared.transformed import WORDS, Tables, Transformed, number_of

from symgen.errors import ModelError

STEPS, SAMPLES = 64, 3
#: Outputs within the error of a run in the plane, which is over the largest stress.
STRESSES = ("bending_strain", "axial_strain", "stress", "greatest_stress")


def round_off(tables: Tables, by: Transformed, results: Results) -> float:
    """Return the part of the largest force that a rounded place makes in the stiffest element.

    A place x is known to eps*x; over the length h of an element it changes the axial force by EA*eps*x/h.
    """
    at = {p: np.array([number_of(x)[0] for x in t["at"]]) for p, t in tables["points"].items() if "at" in t}
    far = max(np.max(np.abs(x + by.shift)) for x in at.values())
    stiffest = 0.0
    for link in tables["links"].values():
        if "elastic" not in link:
            continue
        sizes = {
            key: max(number_of(x)[0] for x in (value if isinstance(value, list) else [value]))
            for key, value in link["section"].items()
            if key != "width_along"
        }
        area = math.pi / 4 * sizes["diameter"] ** 2 if "diameter" in sizes else math.prod(sizes.values())
        length = np.linalg.norm(np.subtract(*(at[p] for p in link["points"]))) / link["elastic"]["elements"]
        stiffest = max(stiffest, number_of(link["elastic"]["E"])[0] * area / length)
    force = max((np.max(np.abs(v)) for k, v in results.items() if k.endswith(".force")), default=0.0)
    return np.finfo(float).eps * far * stiffest / force if force else 0.0


def _of(result) -> Results:
    found = {name: result[name].values for name in result if name.rpartition(".")[2] in WORDS}
    if "potential_energy" in found:  # up to a constant
        found["potential_energy"] = found["potential_energy"] - found["potential_energy"][0]
    return found


def _range(tables, share: float) -> dict:
    """Return the range of a run: a share of a revolution, or of the time of the scene."""
    return {} if "t_end" in tables.get("analysis", {}) else {"revolutions": share}


def run(model, tables, by: Transformed) -> Results:
    result = model.simulate(**_range(tables, 0.01), steps=STEPS, samples=SAMPLES)
    return _of(result) | {"errors": dict.fromkeys(STRESSES, result.statistics["error"])}


def steady(model, tables, by: Transformed) -> Results:
    """A steady state and its largest multiplier, whose error is absolute where differences are relative."""
    result = model.periodic(steps=STEPS, samples=SAMPLES)
    largest = np.abs(result.floquet[:1])
    errors = dict.fromkeys(STRESSES, result.statistics["error"])
    errors["multipliers"] = result.statistics["floquet_error"] / largest[0]
    return _of(result) | {"multipliers": largest, "errors": errors}


def static(model, tables, by: Transformed) -> Results:
    return _of(model.quasi_static(**_range(tables, 0.3), samples=SAMPLES))


def sweep(model, tables, by: Transformed) -> Results:
    """Static shapes at two speeds of a held crank, by one sweep."""
    pace = by.names.get("pace", "pace")
    if pace not in model.parameters:
        raise ModelError("the speed of the crank is no parameter")
    speeds = model.parameters[pace] * np.array([0.8, 1.3])
    runs = model.sweep(
        {pace: speeds}, "quasi_static", revolutions=0.3, samples=SAMPLES, reduce="history", threads=1
    )
    assert not np.any(runs["error"].values != ""), runs["error"].values
    found = {name: runs[name].values for name in runs if name.rpartition(".")[2] in WORDS}
    if "potential_energy" in found:  # up to a constant
        found["potential_energy"] = found["potential_energy"] - found["potential_energy"][:, :1]
    return found


def there_and_back(model) -> tuple[Results, Results]:
    """Return static shapes over a revolution of an undamped linkage, and those of the reverse sense, back in time."""
    pace = model.parameters["pace"]
    ahead, back = (
        _of(model.with_parameters(pace=speed).quasi_static(revolutions=1.0, samples=5))
        for speed in (pace, -pace)
    )
    return ahead, {name: (-x if name.endswith("power") else x)[::-1] for name, x in back.items()}


def modes(model, tables, by: Transformed) -> Results:
    """Squares of frequencies: round-off of a stiffness is a part of the largest square."""
    return {"squares": model.modes().frequencies ** 2}


def moving_modes(model, tables, by: Transformed) -> Results:
    found = model.modes(moving=True)
    return {"squares": np.sort(found.growth**2 + (2 * np.pi * found.frequencies) ** 2)}


def large(model, tables, by: Transformed) -> Results:
    result = model.large_rotation(elements=1, **_range(tables, 0.003), rtol=0.1, samples=SAMPLES)
    return _of(result)


def equilibrium(model, tables, by: Transformed) -> Results:
    found = model.equilibrium(elements=3)
    return {f"{p}.position": np.asarray(x) for p, x in found.state.positions.items() if p in tables["points"]}


def in_space(model, tables, by: Transformed, initial: str = "undeformed") -> Results:
    """A run in space; of round sections, whose width has no direction, what does not depend on it."""
    result = model.simulate(samples=SAMPLES, rtol=0.01, initial=initial)
    found = _without_directions(_powers_as_moments(_of(result), tables, by), tables)
    words = {name.rpartition(".")[2] for name in found}
    return found | {"errors": dict.fromkeys(words, result.statistics["error"])}


def _powers_as_moments(found: Results, tables, by: Transformed) -> Results:
    """Return powers over the rate of the motion.

    Round-off of a force makes that of a moment, and times the rate, that of a power: the power itself may be
    any part of it, since forces are across velocities, or change sign.
    """
    if not tables.get("drivers") and not any("motion" in p for p in tables["points"].values()):
        del found["input_power"]  # nothing moves, and this is round-off
        return found
    rate, _ = number_of(tables["parameters"][by.names.get("rate", "rate")])
    for name in [name for name in found if name.endswith("power")]:
        found[f"{name}.over_rate"] = found.pop(name) / rate
    return found


def _without_directions(found: Results, tables) -> Results:
    links = tables["links"]
    owners = {s["name"]: s["link"] for s in tables.get("stations", ())}
    for name in list(found):
        owner, _, word = name.rpartition(".")
        link = owners.get(owner, owner.partition(".")[0])
        if "diameter" not in links.get(link, {}).get("section", {}):
            continue
        if word in ("moment_z", "bending_strain_z"):
            both = np.hypot(found[name[:-1] + "y"], found.pop(name))
            found[name] = both
            del found[name[:-1] + "y"]
        if word == "moment":
            m = found[name]
            found[name] = np.stack([np.abs(m[..., 0]), np.hypot(m[..., 1], m[..., 2])], axis=-1)
    return found


def quasi_static_in_space(model, tables, by: Transformed) -> Results:
    """The same from a start whose rates are differences of equilibria, which settle to 1e-5 of their size."""
    found = in_space(model, tables, by, "quasi-static")
    return found | {"errors": {word: error + 1e-5 for word, error in found["errors"].items()}}


def equilibrium_in_space(model, tables, by: Transformed) -> Results:
    found = {
        k: np.asarray(v) for k, v in model.equilibrium().outputs.items() if k.rpartition(".")[2] in WORDS
    }
    del found["potential_energy"]  # which has a constant of the places
    return _without_directions(found, tables)
