"""Which variables an output is computed from: a data-flow analysis of a component's source.

It errs on the side of more: order is ignored, an array is one thing, and where the source cannot be followed every
variable is said to depend on every other. A dependency that is named may not exist; one that is not named does not.
"""

from twin.compiler.dependencies.component import dependencies as dependencies
from twin.compiler.dependencies.component import flow as flow
