"""Titles and descriptions reach terminals and comments: no control characters, nor changes of direction."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError

REFUSED = [*range(0x80, 0xA0), 0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]


@pytest.mark.parametrize("key", ["title", "about"])
def test_control_characters_are_refused(key):
    for code in REFUSED:
        with pytest.raises(SceneError, match="expected a text without control characters, got"):
            symgen.build("four_bar", set={key: f"Four{chr(code)}bar"})


def test_letters_of_every_script_are_accepted():
    symgen.build("four_bar", set={"title": "Viergelenk für α, шарнир, 四连杆, آلية, \u00a0\u2013"})
