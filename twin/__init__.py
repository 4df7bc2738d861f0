"""Digital twins of robotic catheters: components, native FMUs and a compiled co-simulation loop."""

__version__ = "0.1.0"
