"""Planar scenes: what instruments move in, read from drawings, and pictures of it."""

import lazy_loader

from twin.scene.environment import Environment, Wall
from twin.scene.environment_files import READERS, names, read
from twin.scene.frames import Frames, along, instants, still
from twin.scene.spec import AXES, Arrow, Line, Mark, Scene

__getattr__, _, _ = lazy_loader.attach(__name__, submodules=["animation", "page", "picture"], submod_attrs={})

__all__ = [
    "AXES",
    "READERS",
    "Arrow",
    "Environment",
    "Frames",
    "Line",
    "Mark",
    "Scene",
    "Wall",
    "along",
    "animation",
    "instants",
    "names",
    "page",
    "picture",
    "read",
    "still",
]
