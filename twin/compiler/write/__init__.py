"""Third stage: the text of a function in C, from its tree and the types that were inferred."""

from twin.compiler.write.code import Code, local_name, number, wrapped
from twin.compiler.write.needs import Needs
from twin.compiler.write.sign import Signs
from twin.compiler.write.statements import Writer

__all__ = ["Code", "Needs", "Signs", "Writer", "local_name", "number", "wrapped"]
