"""Files of results that were altered, or written by others: refused with the field, or usable in full."""

from __future__ import annotations

import copy
import json
from itertools import islice

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import ResultError
from symgen.runtime.digest import digest
from symgen.runtime.result.result import DIGEST


@pytest.fixture(scope="module")
def results():
    """Return a result of every kind."""
    crank, loop, elastic = map(symgen.build, ("crank_rocker", "rssr", "thesis_four_bar"))
    return {
        "run": symgen.build("four_bar").simulate(0.1, samples=4),
        "kinematics": crank.kinematics(samples=4),
        "forces": crank.inverse_dynamics(samples=4),
        "loop": loop.inverse_dynamics(samples=4),
        "elastic": elastic.periodic(samples=4, rtol=0.1),
        "speed_response": elastic.speed_response([20.0, 30.0], rtol=0.1, samples=4),
    }


def contents(file) -> tuple[dict, dict]:
    with np.load(file) as stored:
        arrays = {name: stored[name] for name in stored.files}
    del arrays[DIGEST]
    return arrays, json.loads(str(arrays.pop("symgen")))


def write(file, arrays, meta):
    text = json.dumps(meta)
    np.savez(file, **{"symgen": np.array(text), DIGEST: np.array(digest(arrays, text))}, **arrays)


def use(result):
    """Call whatever a result offers without a model."""
    for name in (
        "headline",
        "facts",
        "peaks",
        "dataset",
        "over",
        "shown",
        "time",
        "poles",
        "undetermined",
        "floquet",
    ):
        if name != "time" or result.coordinate.name != "speed":
            getattr(result, name, None)
    for name in (
        "stable",
        "resonances",
        "verdicts",
        "unstable",
        "greatest",
        "condition",
        "closure",
        "out_of_reach",
    ):
        getattr(result, name, None)
    if "singular_poses" in result.statistics:
        _ = result.singular_poses
    json.dumps(result.summary())
    json.loads(result.meta())
    assert repr(result) and all(len(v.values) == result.count for v in result.variables)


def alterations(arrays, meta):
    """Yield arrays and fields with one fault each."""
    for name, array in arrays.items():
        more = {
            "longer": np.concatenate([array, array[:1]]),
            "shorter": array[1:],
            "whole": array.astype(int),
            "complex": array.astype(complex),
            "single": array.astype(np.float32),
            "text": array.astype(str),
            "deeper": array[..., None],
            "number": np.array(1.0),
        }
        for fault, altered in more.items():
            yield f"{name} {fault}", {**arrays, name: altered}, meta
        yield f"{name} missing", {n: a for n, a in arrays.items() if n != name}, meta
    yield "foreign", {**arrays, "foreign": np.zeros(4)}, meta
    for place in leaves(meta):
        for value in (None, "x", -1, 1.5, [], {}, ["x"], [[1, 2, 3]]):
            altered = copy.deepcopy(meta)
            part = altered
            for key in place[:-1]:
                part = part[key]
            part[place[-1]] = value
            yield f"{place} {value}", arrays, altered
        if isinstance(place[-1], str):
            altered = copy.deepcopy(meta)
            part = altered
            for key in place[:-1]:
                part = part[key]
            del part[place[-1]]
            yield f"{place} missing", arrays, altered


def leaves(data, place=()):
    """Yield the places of all fields and, of lists, of the first entry."""
    entries = (
        data.items() if isinstance(data, dict) else enumerate(data[:1]) if isinstance(data, list) else ()
    )
    for key, value in entries:
        yield (*place, key)
        yield from leaves(value, (*place, key))


@pytest.mark.parametrize("stride", [37, full(1)])
def test_altered_files_are_refused_or_can_be_used(results, tmp_path, stride):
    file, faults, count = tmp_path / "altered.npz", [], 0
    for kind, result in results.items():
        arrays, meta = contents(result.save(tmp_path / f"{kind}.npz"))
        for fault, altered, fields in islice(alterations(arrays, meta), 0, None, stride):
            count += 1
            write(file, altered, fields)
            try:
                loaded = symgen.load_result(file)
            except ResultError as error:
                assert str(error).startswith(f"{file} "), fault
                continue
            try:
                use(loaded)
            except Exception as error:
                faults.append(f"{kind}: {fault}: {error!r}")
    assert not faults, f"{len(faults)} of {count}"


def test_messages_name_the_file_and_the_field(results, tmp_path):
    file = tmp_path / "altered.npz"
    arrays, meta = contents(results["run"].save(file))
    for altered, fields, words in (
        ({**arrays, "energy": arrays["energy"][1:]}, meta, r"energy: expected the shape \(4,\), got \(3,\)"),
        (
            {**arrays, "energy": arrays["energy"].astype(int)},
            meta,
            "energy: expected numbers of type float64, got int64",
        ),
        (arrays, {**meta, "title": "a\u202eb"}, "title: string should match .*, got 'a.u202eb'"),
        (arrays, {**meta, "axes": ["x"]}, "axes: list should have at least 2 items"),
        (arrays, {**meta, "kind": "walk"}, "kind: expected one of run, .*, got 'walk'"),
        (arrays, {**meta, "provenance": {}}, "provenance.method: field required"),
        (
            arrays,
            {**meta, "statistics": {"steps": "3"}},
            "statistics.steps: input should be a valid integer, got '3'",
        ),
    ):
        write(file, altered, fields)
        with pytest.raises(
            ResultError, match=f"altered.npz is not a result of symgen, or is broken: {words}"
        ):
            symgen.load_result(file)


@pytest.mark.parametrize("ending", ["nc", "npz"])
def test_a_changed_number_or_text_is_found(results, tmp_path, ending):
    """The digest covers all numbers and fields, also of netCDF, which has no checksum of its own."""
    result = results["run"]
    file = result.save(tmp_path / f"run.{ending}")
    assert symgen.load_result(file).summary() == result.summary()
    with pytest.raises(ResultError, match="its content differs from the content written"):
        if ending == "npz":
            arrays, meta = contents(file)
            with np.load(file) as stored:
                known = stored[DIGEST]
            arrays["energy"][1] += 1e-9
            np.savez(file, **{"symgen": np.array(json.dumps(meta)), DIGEST: known}, **arrays)
        else:
            written, number = file.read_bytes(), np.array(result["energy"].values[1], ">f8").tobytes()
            assert written.count(number) == 1
            file.write_bytes(written.replace(number, number[:-1] + bytes([number[-1] ^ 1])))
        symgen.load_result(file)
    altered = result.save(tmp_path / "title.nc")
    altered.write_bytes(altered.read_bytes().replace(b'"title": "F', b'"title": "G'))
    with pytest.raises(
        ResultError, match="title.nc is not a result of symgen, or is broken: its content differs"
    ):
        symgen.load_result(altered)
