"""The table of docs/accuracy.md."""

from __future__ import annotations

from pathlib import Path

import pytest
from shared.full import full

from symgen.study.accuracy.accuracy import accuracy


def page_text() -> str:
    """The page docs/accuracy.md."""
    return (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text()


def page(columns: tuple[str, ...]) -> dict[str, list[str]]:
    """Rows of its table by the name of the scene."""
    table = page_text().partition("<!-- benchmarks/kernel_accuracy.py -->")[2].partition("<!-- end -->")[0]
    head, _, *rows = [[c.strip() for c in line.strip("|").split("|")] for line in table.strip().splitlines()]
    assert tuple(head) == columns
    return {row[0]: row for row in rows}


def test_the_page_has_every_scene_and_no_fault_but_those_it_explains(load):
    table = load("kernel_accuracy")
    rows = page(table.COLUMNS)
    assert list(rows) == table.names()
    explained = page_text().partition("The remaining losses and their causes:")[2]
    assert all(f"`{name}`" in explained for name, row in rows.items() if row[-1] == "code")


@pytest.mark.parametrize(
    "scene", ["rod", "loop_inertia", full("triple_pendulum"), "far_origin", full("screw_jack")]
)
def test_the_figures_of_the_page_hold(load, scene):
    """Within a factor: the last bits of functions and of the run differ between machines."""
    table = load("kernel_accuracy")
    for found, told in zip(table.row(accuracy(scene)), page(table.COLUMNS)[scene], strict=True):
        try:
            assert 0.1 < float(found) / float(told) < 10, (scene, found, told)
        except ValueError:  # the words beside the figures
            continue
