"""`twin.component.variable` under its earlier name, for components that were written with it."""

from twin.component.variable import *  # noqa: F403
