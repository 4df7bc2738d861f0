"""Shared by the tests of components: an instance whose start and advance are the compiled ones."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from twin.compiler.native import load_component
from twin.component import Component


@pytest.fixture(scope="session")
def native(build: Path) -> Callable[..., Any]:
    """`native(cls, **values)`: as `cls(**values)`, but compiled."""
    loaded = {}

    def make(cls: type[Component], **values: Any) -> Component:
        if cls not in loaded:
            start, advance = load_component(cls, build)
            kinds = ctypes.c_int32, ctypes.c_void_p, ctypes.c_double
            loaded[cls] = ctypes.CFUNCTYPE(*kinds)(start), ctypes.CFUNCTYPE(*kinds, ctypes.c_double)(advance)
        start, advance = loaded[cls]
        instance = cls(**values)
        address = instance.record.ctypes.data
        instance.start = lambda t=0.0: start(address, t)
        instance.advance = lambda t, h: advance(address, t, h)
        return instance

    return make
