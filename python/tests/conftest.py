"""Shared by the tests: the example, and particles."""

import os
import pathlib

import numpy as np
import pytest

EXAMPLES = os.environ.get("SPHERULE_EXAMPLES", pathlib.Path(__file__).resolve().parents[2] / "examples")
EXAMPLE = pathlib.Path(EXAMPLES) / "dam-break"


@pytest.fixture
def example():
    return EXAMPLE


@pytest.fixture
def ball():
    """A hundred particles near the origin, C-contiguous float32."""
    return np.random.default_rng(3).normal(size=(100, 3)).astype(np.float32)


SMALL = {"size": (32, 18), "samples": 1, "threads": 2}


@pytest.fixture
def small():
    return dict(SMALL)
