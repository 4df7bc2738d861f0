"""`twin.component.noise` under its earlier name, for components that were written with it."""

from twin.component.noise import *  # noqa: F403
