"""Specification of an acceptance: what a contract requires of an antenna, read from a YAML file."""
from typing import NamedTuple

from pedestal_results.intervals import Target
from pedestal_workbench.acceptance.method import Arguments, Method


class Requirement(NamedTuple):
    """A requirement of a specification."""
    name: str               # unique in the specification
    method: Method
    arguments: Arguments    # of the method, checked, with defaults
    limit: Target
    repetitions: int
    confidence: float       # level of the interval of the value [-]


class Specification(NamedTuple):
    """A checked specification."""
    title: str
    customer: str
    antenna: str
    requirements: tuple[Requirement, ...]
    text: str               # of the file, for the report and for the comparison at a continuation
