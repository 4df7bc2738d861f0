"""Second stage: the type of every expression and variable of a function, as it is called with given types.

A function is inferred once for each combination of argument types, as templates are. Types only grow (Boolean, whole,
real), so the text is gone over until nothing changes. On the way it is found what a function writes to, and whether
calling it has any other effect than its result.
"""

from twin.compiler.infer.expressions import element
from twin.compiler.infer.program import Program, TypedFunction
from twin.compiler.infer.statements import Inference, is_range, program
from twin.compiler.infer.static import OPERATORS, NotStaticError

__all__ = ["OPERATORS", "Inference", "NotStaticError", "Program", "TypedFunction", "element", "is_range", "program"]
