"""Members and what couples them: systems, groups, and the compiled co-simulation loop."""

import lazy_loader

from twin.former import note_former

lazy_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Return a lazily imported object, or one under its former name."""
    if name == "Link":
        note_former("twin.coupling.Link", "twin.coupling.ResolvedConnection")
        return lazy_attribute("ResolvedConnection")
    return lazy_attribute(name)
