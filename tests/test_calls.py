"""Calls of the public interface: every call is checked, also after others of the same types."""

from __future__ import annotations

import math

import pytest

from symgen.calls import checked
from symgen.errors import ModelError


@checked
class Interface:
    def named(self, name: str, number: float = 0.0) -> str:
        return f"{name} {number!r}"

    def any_of(self, *names: str) -> int:
        return len(names)


def test_values_are_checked_in_every_call():
    interface = Interface()
    for _ in range(2):  # the second call has the types of the first
        assert interface.named("a") == "a 0.0"
        assert interface.named("a", 2) == "a 2.0"
        assert interface.any_of("a", "b") == 2
        for wrong in ((3,), ("a", math.nan), ("a", "b"), (), ("a", 1.0, 2.0)):
            with pytest.raises(ModelError, match=r"Interface\.named"):
                interface.named(*wrong)
        with pytest.raises(ModelError, match=r"Interface\.any_of: expected text"):
            interface.any_of("a", 1)
        with pytest.raises(ModelError, match="has no argument 'size'"):
            interface.named("a", size=1)
