"""What FMPy works out anew for each FMU, worked out once: most of the time that it takes.

Names are parsed with a grammar that is built for each model description, though components have theirs in both versions
of FMI and in many exports. And the signatures of all functions of FMI are looked up for each instance.
"""

import copy
import inspect
from collections.abc import Callable
from typing import Any

import fmpy.validation
import pytest
from fmpy.model_description import ModelDescription

legal: set[tuple[str, str]] = set()  # naming convention, name
signatures: dict[Callable[..., Any], inspect.Signature] = {}
parse, look_up = fmpy.validation._validate_variable_names, inspect.signature


def unknown_names(description: ModelDescription) -> list[str]:
    """Problems with names that were not yet found legal."""
    convention = description.variableNamingConvention
    rest = copy.copy(description)
    rest.modelVariables = [one for one in description.modelVariables if (convention, one.name) not in legal]
    problems: list[str] = parse(rest) if rest.modelVariables else []
    if not problems:
        legal.update((convention, one.name) for one in rest.modelVariables)
    return problems


def signature(called: Any, **options: Any) -> inspect.Signature:
    """The signature of a function; that of a method of FMPy is the same for every FMU."""
    function = getattr(called, "__func__", None)
    if options or not getattr(function, "__module__", "").startswith("fmpy."):
        return look_up(called, **options)
    if function not in signatures:
        signatures[function] = look_up(called)
    return signatures[function]


def install(patch: pytest.MonkeyPatch) -> None:
    """From now on."""
    patch.setattr(fmpy.validation, "_validate_variable_names", unknown_names)
    patch.setattr(inspect, "signature", signature)
