"""Components with random numbers of their own."""

from __future__ import annotations

from typing import Any

from twin.component import Component, Int64, local, parameter


class Noisy(Component):
    """A component with a stream of random numbers, which `seed_stream` begins."""

    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))


def noise_seed(value: int, of: str) -> Any:
    """Declare the parameter `seed` of a stream; `of`: what is random."""
    text = f"seed of {of}; give every noisy member its own"
    return parameter(value, "", text, type=Int64, fixed=True, source="arbitrary")
