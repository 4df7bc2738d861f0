"""Second stage: the type of every expression and variable of a function, as it is called with given types.

A function is inferred once for each combination of argument types, as templates are. Types only grow (Boolean, whole,
real), so the text is gone over until nothing changes. On the way it is found what a function writes to, and whether
calling it has any other effect than its result.
"""

from twin.compiler.infer.expressions import element as element
from twin.compiler.infer.program import Program as Program
from twin.compiler.infer.program import TypedFunction as TypedFunction
from twin.compiler.infer.statements import Inference as Inference
from twin.compiler.infer.statements import is_range as is_range
from twin.compiler.infer.statements import program as program
from twin.compiler.infer.static import OPERATORS as OPERATORS
from twin.compiler.infer.static import NotStaticError as NotStaticError
