"""Planar scenes: what instruments move in, read from drawings, and pictures of it."""

from twin import late
from twin.scene.environment import Environment, Wall
from twin.scene.frames import Frames, along, instants, still
from twin.scene.reading import READERS, names, read
from twin.scene.spec import AXES, Arrow, Line, Mark, Scene

__getattr__ = late.names(__name__, {"film": "", "page": "", "picture": ""})

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
    "film",
    "instants",
    "names",
    "page",
    "picture",
    "read",
    "still",
]
