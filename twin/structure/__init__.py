"""How a co-simulation hangs together and what it costs: picture, delays, feedthrough, profile."""

from twin.structure import picture
from twin.structure.graph import Part, Structure, Wire, structure
from twin.structure.profile import Cost, Profile, profiled

__all__ = ["Cost", "Part", "Profile", "Structure", "Wire", "picture", "profiled", "structure"]
