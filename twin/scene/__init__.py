"""Scenes: environments of instruments, read from drawings, pictures of runs in them, and scenes in three dimensions."""

import lazy_loader

from twin.scene.environment import Environment, Wall
from twin.scene.environment_files import READERS, read_environment, shipped_environments
from twin.scene.frames import Frames, points_along_path, scene_instants, still_frames
from twin.scene.space import Space, SpaceForce, SpaceLine, SpacePath, SpacePoint, SpaceView, Surface
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
    "Space",
    "SpaceForce",
    "SpaceLine",
    "SpacePath",
    "SpacePoint",
    "SpaceView",
    "Surface",
    "Wall",
    "animation",
    "page",
    "picture",
    "points_along_path",
    "read_environment",
    "scene_instants",
    "shipped_environments",
    "still_frames",
]
