"""How a co-simulation hangs together and what it costs: picture, delays, feedthrough, profile."""

from twin.structure import picture as picture
from twin.structure.graph import GraphMember as GraphMember
from twin.structure.graph import Structure as Structure
from twin.structure.graph import Wire as Wire
from twin.structure.graph import short_name as short_name
from twin.structure.graph import structure as structure
from twin.structure.profile import Cost as Cost
from twin.structure.profile import CostProfile as CostProfile
from twin.structure.profile import profiled as profiled
