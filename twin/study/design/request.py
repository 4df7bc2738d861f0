"""A case that is to be run, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

SAMPLED = "sample"  # part of a study; the others are `worst` and `tune`


@dataclass(frozen=True)
class StudyRequest:
    """One case: a variant with a seed and values of the factors, NaN where the scenario's own stay.

    `number` counts from 1 through the whole study, `sample` through its samples. `extra`: knobs of a tuning.
    """

    number: int
    part: str
    sample: int
    variant: str
    seed: int
    values: tuple[float, ...]
    extra: tuple[float, ...] = ()

    @property
    def all_values(self) -> tuple[float, ...]:
        """Of the factors, then of the knobs."""
        return self.values + self.extra
