"""Stores of sweeps with damaged files: the damage is named, and the results are those of a new sweep."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import xarray
from shared.linkages import GRAVITY, at, ground, rod

import symgen
from symgen.errors import ResultError


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
        (".zgroup", b"{}", r"runs.zarr.\.zgroup is damaged: it is restored"),
        (".zgroup", None, r"runs.zarr.\.zgroup is damaged: it is restored"),
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


def sweep(model, path, **options):
    return model.sweep(
        {"l": [1.0, 2.0, 3.0, 4.0, 5.0]},
        analysis="inverse_dynamics", outputs=["r.torque"], samples=5, chunk=2, file=path, **options,
    )  # fmt: skip


@pytest.mark.parametrize("data", [b"", b"{}", b"[1]", b'{"sweep": {}}', None])
def test_a_damaged_description_of_the_store_is_named(model, tmp_path, data):
    """It names the sweep, so that the results cannot be taken for those of any."""
    path = tmp_path / "runs.zarr"
    sweep(model, path).close()
    (path / ".zattrs").unlink() if data is None else (path / ".zattrs").write_bytes(data)
    with pytest.raises(ResultError, match=r"runs.zarr.\.zattrs is damaged.*\n  Restore .* remove the store"):
        sweep(model, path)
    (tmp_path / "other.zarr").mkdir()
    with pytest.raises(ResultError, match=r"other.zarr is not the store of a sweep$"):
        sweep(model, tmp_path / "other.zarr")


def test_descriptions_of_other_versions_are_no_damage(model, tmp_path, recwarn):
    """Versions of Zarr differ in defaults that they write, and programs add attributes."""
    path = tmp_path / "runs.zarr"
    before = sweep(model, path).load()
    for file in path.rglob(".zarray"):
        data = json.loads(file.read_bytes())
        data["compressor"].pop("checksum")
        data["filters"] = data["filters"] or []
        file.write_text(json.dumps({**data, "dimension_separator": "."}, indent=7))
    for file in path.rglob(".zattrs"):
        file.write_text(json.dumps({**json.loads(file.read_bytes()), "history": "seen"}))
    assert sweep(model, path).load().equals(before)
    assert not [str(w.message) for w in recwarn if "damaged" in str(w.message)]


def test_an_array_that_is_missing_is_computed_again(model, tmp_path):
    """As in stores of earlier versions, which did not have it."""
    path = tmp_path / "runs.zarr"
    before = sweep(model, path).load()
    shutil.rmtree(path / "r.torque.peak")
    with pytest.warns(UserWarning, match="is damaged.*: it is (restored|computed again)"):
        assert sweep(model, path).load().equals(before)


def test_damage_of_another_part_is_named(model, tmp_path):
    path = tmp_path / "runs.zarr"
    for part in ((1, 2), (2, 2)):
        sweep(model, path, part=part).close()
    (path / "r.torque.peak" / "1").unlink()
    with pytest.warns(UserWarning, match=r"chunk 1 of .*runs 2 to 3, is damaged .*: continue its part of"):
        sweep(model, path, part=(1, 2))
    with pytest.warns(UserWarning, match=r"chunk 1 of .*runs 2 to 3, is damaged .*: it is computed again"):
        assert np.isfinite(sweep(model, path, part=(2, 2))["r.torque.peak"].values).all()


def test_any_reader_finds_changed_bytes(model, tmp_path):
    """Chunks have a checksum in their compressed form."""
    file = tmp_path / "runs.zarr" / "r.torque.peak" / "0"
    sweep(model, tmp_path / "runs.zarr").close()
    written = file.read_bytes()
    for place in range(8, len(written)):
        file.write_bytes(written[:place] + bytes([written[place] ^ 1]) + written[place + 1 :])
        with pytest.raises(RuntimeError):
            xarray.open_zarr(tmp_path / "runs.zarr", consolidated=False)["r.torque.peak"].values[:2].sum()
