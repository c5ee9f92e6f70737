"""Stores of sweeps with damaged files: the damage is named, and the results are those of a new sweep."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import GRAVITY, at, ground, rod

import symgen


@pytest.fixture(scope="module")
def model():
    return symgen.build(
        symgen.Scene(
            parameters={"w": "60 rpm", "l": {"value": "1 m", "tunable": True}},
            points={"O": ground(0, 0), "P": at(1, 0)},
            links={"r": rod("O", "P", length="l")},
            drivers=[{"link": "r", "angle": "w*t"}],
            gravity=GRAVITY,
            analysis={"t_end": "1 s"},
        )
    )


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("l/.zarray", b"{}", r"l.\.zarray is damaged"),
        ("done/.zarray", b"{}", r"done.\.zarray is damaged"),
        ("r.torque.peak/1", b"\x28\xb5\x2f", r"chunk 1 of .*, runs 2 to 3, is damaged"),
        ("r.torque.peak/1", None, r"chunk 1 of .*, runs 2 to 3, is damaged \(its digest differs"),
        ("error/0", b"", r"chunk 0 of .*, runs 0 to 1, is damaged"),
        ("done/2", b"x", r"chunk 2 of .*, runs 4 to 4, is damaged"),
    ],
)
def test_damage_is_named_and_computed_again(model, tmp_path, name, data, words):
    """The torque of a uniform rod at its start is m g l/2."""
    path = tmp_path / "runs.zarr"
    lengths = [1.0, 2.0, 3.0, 4.0, 5.0]
    options = {
        "analysis": "inverse_dynamics",
        "outputs": ["r.torque"],
        "samples": 5,
        "chunk": 2,
        "file": path,
    }
    model.sweep({"l": lengths}, **options).close()
    file = path / name
    file.unlink() if data is None else file.write_bytes(data)
    with pytest.warns(UserWarning, match=words):
        runs = model.sweep({"l": lengths}, **options)
    assert runs["l"].values.tolist() == lengths
    assert runs["r.torque.peak"].values == pytest.approx(9.81 / 2 * np.array(lengths), rel=1e-12)
