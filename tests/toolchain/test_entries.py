"""Entries of the cache: what they depend on, descriptions of the wrong shape."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import symgen
from symgen.toolchain import dependencies as graph
from symgen.toolchain.cache import Cache

#: Builds a scene, and prints which files of the runtime ran code while its entry was made.
WATCHED = """
import sys
from pathlib import Path
from symgen.pipeline import build as pipeline
ran, compile_scene = set(), pipeline.compile_scene
def watched(*arguments):
    sys.setprofile(lambda frame, event, argument: ran.add(frame.f_code.co_filename))
    try:
        return compile_scene(*arguments)
    finally:
        sys.setprofile(None)
pipeline.compile_scene = watched
pipeline.build(sys.argv[1], backend="numpy")
parts = sorted(file.partition("/symgen/runtime/")[2] for file in ran if "/symgen/runtime/" in file)
print(*(part for part in parts if part.endswith(".py")))
"""


@pytest.mark.parametrize(
    ("scene", "decides"),
    [
        ("parallelogram", {"integrate/redundancy.py", "integrate/causes.py"}),
        ("rssr", {"closure/closed_form.py", "loop/frames.py"}),
    ],
)
def test_an_entry_depends_on_every_module_that_ran_for_it(cache, monkeypatch, scene, decides):
    done = subprocess.run([sys.executable, "-c", WATCHED, scene], capture_output=True, text=True, check=True)
    ran = {*done.stdout.split()}
    assert decides <= ran
    (entry,) = cache.iterdir()
    name, needs = entry.name.rpartition("-")[0], json.loads((entry / "needs.json").read_text())
    ours = {need.removeprefix("symgen:runtime/") for need in needs if need.startswith("symgen:runtime/")}
    assert {part for part in ran - ours if not part.endswith("__init__.py")} == set()
    assert graph.current(Cache(), name)
    for changed in decides:
        with monkeypatch.context() as patched:
            content = graph.content
            patched.setattr(graph, "content", lambda n, f=changed, c=content: "" if n.endswith(f) else c(n))
            assert graph.current(Cache(), name) is None, f"{changed} decides nothing"


def test_an_entry_depends_on_the_version(cache, monkeypatch):
    symgen.build("four_bar", backend="numpy")
    graph.content_of_package.cache_clear()
    monkeypatch.setattr("symgen.version.__version__", "99.0")
    symgen.build("four_bar", backend="numpy")
    graph.content_of_package.cache_clear()
    assert len([*cache.iterdir()]) == 2


def test_what_is_made_from_a_description_depends_on_it(cache):
    """Kernels of an analysis hold start and redundancy of the scene that they were first made for."""
    model = symgen.build("parallelogram", backend="numpy")
    (base,) = cache.iterdir()
    model.equilibrium()
    description = json.loads((base / "description.json").read_text())
    description["title"] = "changed"
    write_entry(base, "description.json", json.dumps(description))
    model = symgen.build("parallelogram", backend="numpy")
    assert model.description.title == "changed"
    assert model.analysis("statics").description.title == "changed"


def write_entry(entry, file, text):
    """Change a file of an entry together with its checksum, as an older version of symgen might have left it."""
    import hashlib

    (entry / file).write_text(text)
    sums = json.loads((entry / "checksums.json").read_text())
    sums[file] = hashlib.sha256(text.encode()).hexdigest()
    (entry / "checksums.json").write_text(json.dumps(sums))


@pytest.mark.parametrize(
    "change",
    [
        lambda d: [],
        lambda d: None,
        lambda d: {**d, "axes": 5},
        lambda d: {**d, "start": ["1"] * len(d["start"])},
        lambda d: {**d, "start": d["start"][:3]},
        lambda d: {**d, "kernels": "none"},
        lambda d: {**d, "kernels": [{**d["kernels"][0], "blocks": [None]}]},
        lambda d: {**d, "links": [1, 2]},
        lambda d: {**d, "labels": None},
        lambda d: {**d, "elastic": 3},
        lambda d: {**d, "parameters": [1]},
        lambda d: {**d, "novel": 1},
        lambda d: {key: value for key, value in d.items() if key != "constraints"},
    ],
)
def test_a_description_of_the_wrong_shape_is_made_again(cache, change):
    expected = symgen.build("four_bar", backend="numpy").accelerations().as_dict()
    (entry,) = cache.iterdir()
    text = (entry / "description.json").read_text()
    write_entry(entry, "description.json", json.dumps(change(json.loads(text))))
    assert symgen.build("four_bar", backend="numpy").accelerations().as_dict() == expected
    (again,) = cache.iterdir()
    assert (again / "description.json").read_text() == text
