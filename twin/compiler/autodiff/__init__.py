"""Directional derivatives exact to rounding: a component's functions rewritten so that every value carries its tangent.

Forward mode by source: `self.y = sin(self.u)` becomes `v = sin(self.u)`, `d = dot.u * cos(self.u)`, `self.y = v`,
`dot.y = d`, with `dot` a second record of the same layout. Values are computed as before, to the bit, and decide which
branch is taken. At a kink the slope is that of the branch; where a square root starts, its infinite slope counts as 0,
so that sqrt(x) * x keeps its finite one. What is not understood is a reason, not a guess.
"""

from twin.compiler.autodiff.component import Tangents as Tangents
from twin.compiler.autodiff.component import tangents as tangents
