"""What FMPy works out anew for each FMU, worked out once: most of the time that it takes.

Names are parsed with a grammar that is built for each model description, though components have theirs in both versions
of FMI and in many exports, and though most differ in their words and indices alone. And the signatures of all
functions of FMI are looked up for each instance.
"""

import copy
import inspect
import re
from collections.abc import Callable
from typing import Any

import fmpy.validation
import pytest
from fmpy.model_description import ModelDescription

legal: set[tuple[str, str]] = set()  # naming convention, form of a name
signatures: dict[Callable[..., Any], inspect.Signature] = {}
parse, look_up = fmpy.validation._validate_variable_names, inspect.signature


def form(name: str) -> str:
    """A name with 1 for every index and `a` for every word: the grammar takes any number and, but `der`, any word there."""
    return re.sub(r"(?<=[\[,])\d+(?=[\],])", "1", re.sub(r"\b(?!der\b)[A-Za-z_]\w*", "a", name, flags=re.ASCII))


def unknown_names(description: ModelDescription) -> list[str]:
    """Problems with names of forms that were not yet found legal."""
    convention = description.variableNamingConvention
    forms = {(convention, form(one.name)): one for one in description.modelVariables}
    rest = copy.copy(description)
    rest.modelVariables = [one for key, one in forms.items() if key not in legal]
    if rest.modelVariables and parse(rest):
        problems: list[str] = parse(description)
        return problems
    legal.update(forms)
    return []


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
