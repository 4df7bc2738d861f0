"""Third stage: the text of a function in C, from its tree and the types that were inferred."""

from twin.compiler.codegen.code import local_name, number, wrapped
from twin.compiler.codegen.file_context import FileContext
from twin.compiler.codegen.nonnegative_analysis import NonnegativeAnalysis
from twin.compiler.codegen.statements import FunctionWriter

__all__ = ["FileContext", "FunctionWriter", "NonnegativeAnalysis", "local_name", "number", "wrapped"]
