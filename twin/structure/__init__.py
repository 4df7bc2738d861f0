"""How a co-simulation hangs together and what it costs: picture, delays, feedthrough, profile."""

from twin.structure import picture
from twin.structure.graph import GraphMember, Structure, Wire, structure
from twin.structure.profile import Cost, CostProfile, profiled

__all__ = ["Cost", "CostProfile", "GraphMember", "Structure", "Wire", "picture", "profiled", "structure"]
