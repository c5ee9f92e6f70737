"""Values that are equal or zero only analytically: a scene written with them is the same scene."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError
from symgen.scene.loading import read_scene
from symgen.scene.units import is_quantity, parse_quantity

AS_WRITTEN = {"parameters", "title", "symgen", "units", "analysis"}
ZERO = "(sin(2*w__) - 2*sin(w__)*cos(w__))"


def disguised(data: dict) -> tuple[dict, int]:
    """Write every quantity q as q*cos(w)^2 + q*sin(w)^2, and zeros as what vanishes; count them."""
    parameters = {**data.get("parameters", {}), "w__": 0.3}

    def written(value):
        if isinstance(value, dict):
            return {k: written(v) for k, v in value.items()}
        if isinstance(value, list):
            return [written(v) for v in value]
        if not (isinstance(value, str) and is_quantity(value)):
            return value
        name = f"q{len(parameters)}__"
        if parse_quantity(value)[0] == 0:
            parameters[name] = value.replace("0", "1", 1)
            return f"{name}*{ZERO}"
        parameters[name] = value
        return f"{name}*cos(w__)**2 + {name}*sin(w__)**2"

    new = {k: v if k in AS_WRITTEN else written(v) for k, v in data.items()}
    count = len(parameters) - len(data.get("parameters", {})) - 1
    return {**new, "parameters": parameters}, count


@pytest.mark.parametrize("name", ["four_bar", "tumbling_body", "collinear_chain", "rssr", "slider_crank"])
def test_a_scene_of_equal_values_has_the_same_start_and_accelerations(name):
    data, count = disguised(dict(read_scene(name).data))
    assert count >= 5
    model, other = symgen.build(name, backend="numpy"), symgen.build(symgen.Scene(**data), backend="numpy")
    np.testing.assert_allclose(other.description.start, model.description.start, atol=1e-15)
    if not hasattr(model.description, "joints"):
        known, found = model.accelerations(), other.accelerations()
        for point, vector in known.points.items():
            np.testing.assert_allclose(found[point], vector, rtol=1e-13, atol=1e-13)


def rod(**changes) -> dict:
    link = {"points": ["O", "A"], "mass": "1 kg", **changes.pop("rod", {})}
    return {
        "parameters": {"w__": 0.3, "b": "2 m", "m": "1 kg"},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}, **changes},
        "links": {"rod": link},
    }


@pytest.mark.parametrize(
    "data, message",
    [
        (rod(A={"at": [f"b*{ZERO}", "0 m"]}), "zero length: O and A are the same place"),
        (rod(rod={"length": f"b*{ZERO}"}), "expected a length above zero, got .* which is 0 m"),
        (rod(rod={"length": f"b/{ZERO}"}), "divides by zero"),
        (rod(rod={"mass": f"m*{ZERO}"}), "the point A|carries no mass"),
    ],
)
def test_what_vanishes_is_refused_as_zero_is(data, message):
    with pytest.raises(SceneError, match=message):
        symgen.build(symgen.Scene(**data), backend="numpy")
