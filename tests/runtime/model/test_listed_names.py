"""Names that ``dir`` and ``help`` list."""

import pydoc

import pytest

import symgen


@pytest.mark.parametrize("scene", ["four_bar", "slider_crank", "elastic_slider_crank"])
def test_dir_lists_the_interface_alone(scene):
    model = symgen.build(scene)
    names = dir(model)
    assert not [name for name in names if name.startswith("_")]
    assert not {"evaluator", "library", "layout", "kernels", "MISSING", "typed"} & {*names}
    assert {"capabilities", "parameters", "equations", "sensitivity", "draw"} <= {*names}
    assert {*model.capabilities} <= {*names}


def test_help_of_a_scene_is_short():
    text = pydoc.render_doc(symgen.Scene, renderer=pydoc.plaintext)
    assert "Scene(*, name='scene', **tables)" in text and "called(self" in text
    assert len(text.splitlines()) < 50 and "pydantic_" not in text
