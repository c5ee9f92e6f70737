"""Headless Chromium for tests of pages: ``benchmarks/browser.py``, which is no package."""

import importlib.util
import sys
from pathlib import Path

import pytest


def _browser():
    file = Path(__file__).parents[2] / "benchmarks" / "browser.py"
    spec = importlib.util.spec_from_file_location("browser", file)
    module = importlib.util.module_from_spec(spec)
    sys.modules["browser"] = module
    spec.loader.exec_module(module)
    return module


browser = _browser()
in_chromium = pytest.mark.skipif(
    browser.chromium() is None, reason="needs Chromium (apt install chromium), and there is none"
)
