"""Every joint of the registry says what its row may hold."""

from __future__ import annotations

import pytest

from symgen.joints import JOINTS
from symgen.scene.loop import ENTRIES


@pytest.mark.parametrize("letter", JOINTS)
def test_entries_of_a_joint(letter):
    joint = JOINTS[letter]
    coupled = [entry for entry, _ in joint.coupled]
    assert joint.letter == letter and joint.name
    assert {*joint.varies, *joint.zero, *coupled} <= set(ENTRIES)
    assert list(joint.varies) == [e for e in ENTRIES if e in joint.varies], "in the order of the motions"
    assert not set(joint.varies) & {*joint.zero, *coupled}
    assert {freedom for _, freedom in joint.coupled} <= set(joint.varies)
    assert joint.freedoms == len(joint.varies) > 0
