"""Third stage: the text of a function in C, from its tree and the types that were inferred."""

from twin.compiler.codegen.code import local_name as local_name
from twin.compiler.codegen.code import number as number
from twin.compiler.codegen.code import wrapped as wrapped
from twin.compiler.codegen.file_context import FileContext as FileContext
from twin.compiler.codegen.nonnegative_analysis import NonnegativeAnalysis as NonnegativeAnalysis
from twin.compiler.codegen.statements import FunctionWriter as FunctionWriter
