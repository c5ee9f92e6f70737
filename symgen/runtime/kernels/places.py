"""Keys of a scene by the labels of the constraints that they make."""

from __future__ import annotations

from collections.abc import Callable


def key_of(constraint: str, label: str, driver: Callable[[str], str]) -> str:
    """Return the key of the scene that makes a constraint; ``driver`` returns that of the drive of a link."""
    last = label.rpartition(" ")[2]
    if label.startswith("the drive "):
        return driver(last)
    if " link " in label:
        return f"links.{last}" if label.startswith("the length ") else f"links.{last}.points"
    if label.startswith("the guide "):
        return f"guides.{constraint.split('_')[1]}"
    if label.startswith("the rigid joint "):  # of a point off an elastic link
        return f"points.{last}"
    return "welds" if label.startswith("the weld ") else "joints"
