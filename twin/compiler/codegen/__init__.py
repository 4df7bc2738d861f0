"""Third stage: the text of a function in C, from its tree and the types that were inferred."""

from twin.compiler.codegen.code import Code, local_name, number, wrapped
from twin.compiler.codegen.file_context import FileContext
from twin.compiler.codegen.nonnegative_analysis import NonnegativeAnalysis
from twin.compiler.codegen.statements import Writer

__all__ = ["Code", "FileContext", "NonnegativeAnalysis", "Writer", "local_name", "number", "wrapped"]
