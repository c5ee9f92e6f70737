"""Mutated scene files: a scene or a named error."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from shared.full import full
from shared.mutations import (
    CANARY,
    Forbidden,
    Hang,
    check_message,
    judge,
    scene_files,
    warm_up,
    watched,
    within,
)

import symgen
from symgen.errors import SceneError

#: On a machine that does other things besides.
PATIENCE = 20.0


@pytest.mark.parametrize("files", [30, full(1000)])
def test_mutated_scenes_give_a_scene_or_a_named_error(files, tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    warm_up()
    outcomes = set()

    @settings(
        max_examples=files,
        derandomize=True,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scene_files())
    def one(content):
        outcomes.add(judge(content, tmp_path, PATIENCE)[0])

    one()
    assert outcomes >= {"SceneError", "resolved", "derived"}
    assert {p.name for p in tmp_path.iterdir()} == {"cache", "scene.toml"}


def test_what_must_not_be_is_seen(tmp_path):
    """The judge finds each kind of fault that it is there for."""
    cache = tmp_path / "cache"
    cache.mkdir()
    with watched(cache):
        (cache / "allowed").write_text("")
    with pytest.raises(Forbidden, match="stolen"), watched(cache):
        (tmp_path / "stolen").write_text("")
    with pytest.raises(Forbidden, match="remove"), watched(cache):
        (tmp_path / "stolen").unlink()
    with pytest.raises(Forbidden, match="Popen"), watched(cache):
        subprocess.run(["true"], check=True)
    with pytest.raises(Forbidden, match="system"), watched(cache):
        os.system("true")
    with pytest.raises(Forbidden, match="code of the scene"), watched(cache):
        eval(f"{CANARY}()")
    with pytest.raises(Hang), within(0.05):
        while True:
            pass
    for text in (
        "",
        "Traceback (most recent call last)",
        "got <Symbol object at 0x7f>",
        "a\x00b",
        "x" * 10_000,
    ):
        with pytest.raises(AssertionError):
            check_message(text)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("symgen = 1", f"symgen = [{', '.join(['7'] * 9999)}]"),
        ("[points]", f"[{'t' * 3000}]\n[points]"),
        ("[points]", '["\\u0000\\u001b[2J\\n\\u202e"]\n[points]'),
        ('title = "', 'titel = "\\u0007'),
        ("[points]", '["\\u0009"]\n[points]'),
    ],
)
def test_what_a_scene_says_is_shown_readably(old, new, tmp_path):
    text = (Path(symgen.__file__).parent / "scenes" / "four_bar.toml").read_text()
    assert old in text
    (tmp_path / "bad.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        symgen.load_scene(tmp_path / "bad.toml")
    said = str(caught.value)
    assert said.startswith("bad.toml: ")
    assert len(said) < 2500
    assert all(c == "\n" or c.isprintable() for c in said)
