"""What differs between FMI 2.0 and 3.0 where FMUs are read and called: names, not steps. FMI 2.0.4 and 3.0.1."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class FmiVersion:
    """A version of the standard.

    `types`: elements of variables in modelDescription.xml. `has_sizes`: whether functions that move values get their number.
    `function_types`: the part of `fmiNGetXXX` that stands for a type, `function_names`: of other functions, both where it
    differs from FMI 3.0's. `capability_names`: of attributes, likewise. Paths and keys are those of modelDescription.xml.
    """

    number: str
    prefix: str
    token: str
    types: frozenset[str]
    has_sizes: bool
    function_types: Mapping[str, str]
    type_definitions: str
    unknown_key: str
    outputs: str
    initial_unknowns: str
    derivatives: str
    function_names: Mapping[str, str] = field(default_factory=dict)
    capability_names: Mapping[str, str] = field(default_factory=dict)
    platform_folders: Mapping[str, str] = field(default_factory=dict)

    def function(self, name: str) -> str:
        """Return the name of a function in this version from its name in FMI 3.0 without the prefix."""
        return f"{self.prefix}{self.function_names.get(name, name)}"

    def platform_folder(self, platform: str) -> str:
        """Return the folder below `binaries/` of a platform named as in FMI 3.0."""
        return self.platform_folders.get(platform, platform)


FMI2 = FmiVersion(
    number="2.0",
    prefix="fmi2",
    token="guid",  # noqa: S106 - the name of an attribute
    types=frozenset({"Real", "Integer", "Boolean", "String", "Enumeration"}),
    has_sizes=False,
    function_types={"Float64": "Real", "Int32": "Integer", "Enumeration": "Integer"},
    type_definitions="TypeDefinitions/SimpleType",
    unknown_key="index",
    outputs="ModelStructure/Outputs/Unknown",
    initial_unknowns="ModelStructure/InitialUnknowns/Unknown",
    derivatives="ModelStructure/Derivatives/Unknown",
    function_names={
        "GetFMUState": "GetFMUstate",
        "SetFMUState": "SetFMUstate",
        "FreeFMUState": "FreeFMUstate",
        "SerializedFMUStateSize": "SerializedFMUstateSize",
        "SerializeFMUState": "SerializeFMUstate",
        "DeserializeFMUState": "DeSerializeFMUstate",
        "GetContinuousStateDerivatives": "GetDerivatives",
    },
    capability_names={
        "canGetAndSetFMUState": "canGetAndSetFMUstate",
        "canSerializeFMUState": "canSerializeFMUstate",
        "providesDirectionalDerivatives": "providesDirectionalDerivative",
    },
    platform_folders={"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"},
)
FMI3 = FmiVersion(
    number="3.0",
    prefix="fmi3",
    token="instantiationToken",  # noqa: S106 - the name of an attribute
    types=frozenset(
        {
            *("Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"),
            *("Boolean", "String", "Binary", "Enumeration", "Clock"),
        }
    ),
    has_sizes=True,
    function_types={"Enumeration": "Int64"},
    type_definitions="TypeDefinitions/*",
    unknown_key="valueReference",
    outputs="ModelStructure/Output",
    initial_unknowns="ModelStructure/InitialUnknown",
    derivatives="ModelStructure/ContinuousStateDerivative",
)
