"""The instrument of `chain_on_wall` in any environment: `component: "fmus.bodies.anywhere:aortic_arch"`, or a file's name.

A name is looked up as `twin.scene.read` does; a file from the folder where the command is run.
"""

from __future__ import annotations

from functools import cache

from fmus.chain_on_wall.model import ChainOnWall
from twin.scene import read_environment


@cache
def component(environment: str) -> type[ChainOnWall]:
    """The component for an environment; the same class for the same name."""
    read_environment(environment)  # mistakes in it are reported before anything runs
    name = "".join(letter if letter.isalnum() else "_" for letter in environment)
    return type(f"ChainIn_{name}", (ChainOnWall,), {"environment": environment, "__module__": __name__})


def __getattr__(name: str) -> type[ChainOnWall]:
    if name.startswith("__"):
        raise AttributeError(name)
    return component(name)
