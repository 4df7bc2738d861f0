"""`twin.component.solver` under its earlier name, for components that were written with it."""

from twin.component.solver import *  # noqa: F403
