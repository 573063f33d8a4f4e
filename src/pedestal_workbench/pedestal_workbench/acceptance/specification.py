"""Specification of an acceptance: what a contract requires of an antenna, read from a YAML file.

All problems of a file are found before anything moves, and are stated together, a line for each of them.
"""
import dataclasses
import hashlib
import math
import re
from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import yaml

from pedestal_common import parameters
from pedestal_common.parameters import Parameters, did_you_mean
from pedestal_common.quantities import Json
from pedestal_common.text_files import files, plain_yaml
from pedestal_common.text_files.files import FilePath
from pedestal_common.wire import commands
from pedestal_results.intervals import CONFIDENCE_LEVEL, Target
from pedestal_workbench.acceptance.exercise import Exercise, Performer
from pedestal_workbench.acceptance.method import Arguments, Method
from pedestal_workbench.acceptance.methods import METHOD_BY_NAME

_P = TypeVar('_P', bound=Parameters)
MAX_REQUIREMENTS, MAX_NAME_CHARS, MAX_TEXT_CHARS, MAX_PROBLEM_CHARS = 200, 60, 500, 400
"""Largest number of requirements, length of a name, of another text, of a line on a problem."""
NO_FILE_PATTERN = re.compile(r'[^\w.,()+-]+|^[.-]+')     # parts of the name of a requirement that no file has
_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
LIMIT_PATTERN = re.compile(rf'(?:<=|>=|<|>) {_NUMBER}|{_NUMBER} (?:\+-|to) {_NUMBER}')
LIMIT_WORDS = {'<=': ('<=', '<', '+-', 'to'), '>=': ('>=', '>', '+-', 'to'), '+-': ('+-', 'to')}
"""{Method.better: words of a limit that make sense}."""


@dataclasses.dataclass(frozen=True)
class Head(Parameters):
    """Head of a file, which the report repeats."""
    title: str = parameters.text('', 'title of the report')
    customer: str = parameters.text('', 'name of the customer')
    antenna: str = parameters.text('', 'name of the antenna')
    tester: str = parameters.text('', 'name of the person who tests')
    calibration: str = parameters.text('', 'calibration in force, in words')


@dataclasses.dataclass(frozen=True)
class Entry(Parameters):
    """Entry of a file for a requirement, without its arguments."""
    name: str = parameters.text('', 'name, unique in the file')
    method: str = parameters.text('', 'name of the method')
    limit: str = parameters.text('', 'limit of the value')
    unit: str = parameters.text('', 'unit of the method')
    repetitions: int = parameters.parameter(1, 1, 100, '', 'number of repetitions')
    confidence: float = parameters.parameter(CONFIDENCE_LEVEL, 0.5, 0.999, '', 'level of the interval of the value')


class Requirement(NamedTuple):
    """A requirement of a specification."""
    name: str               # unique in the specification
    method: Method
    arguments: Arguments    # of the method, checked, with defaults
    limit: Target
    repetitions: int
    confidence: float       # level of the interval of the value [-]

    @property
    def file_name(self) -> str:
        """Name of its files, without an ending."""
        return NO_FILE_PATTERN.sub('_', self.name)


class Specification(NamedTuple):
    """A checked specification."""
    head: Head
    requirements: tuple[Requirement, ...]
    text: str               # of the file, for the report and for the comparison at a continuation

    @property
    def sha256(self) -> str:
        """SHA-256 of the file."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def exercises(self, performer: Performer) -> list[Exercise]:
        """Return the exercise of each requirement. Raises ValueError with a line for each one that the antenna or its
        performer cannot make."""
        exercises, problems = [], []
        for requirement in self.requirements:
            method, antenna = requirement.method, performer.antenna
            try:
                exercises.append(method.exercise(antenna, requirement.arguments))
                for node, fault in exercises[-1].faults:
                    if node not in antenna.simulated:
                        raise ValueError(f'method = {method.name}: {fault} of {node}: must be of a simulated node')
                performer.check(exercises[-1])
            except ValueError as error:
                problems.append(f'requirement {requirement.name!r}: {error}')
        if problems:
            raise ValueError('\n'.join(problems))
        return exercises


def read(path: FilePath, tester: str = '') -> Specification:
    """Return the specification of a file. tester: replaces that of the file. Raises ValueError, which names file,
    entry, field and value."""
    try:
        text = files.read_text(path, plain_yaml.MAX_YAML_BYTES)
        content = plain_yaml.parse(text)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        hint = "; a limit that begins with > stands in quotes: '>= 1'" if 'block scalar' in str(error) else ''
        raise ValueError(f'{path}: {plain_yaml.problem(error)}{hint}') from None
    if not isinstance(content, dict) or not isinstance(entries := content.pop('requirements', None), list):
        raise ValueError(f'{path}: must hold the list requirements, and {", ".join(parameters.defaults(Head))}')
    head, problems, requirements = Head(), list[str](), dict[str, Requirement]()
    try:
        head = _built(Head, {**content, 'tester': tester or content.get('tester', '')}, 'title')
        if not 1 <= len(entries) <= MAX_REQUIREMENTS:
            raise ValueError(f'requirements: {len(entries)} entries, must be 1 to {MAX_REQUIREMENTS}')
    except ValueError as error:
        problems.append(str(error))
    for number, entry in enumerate(entries[:MAX_REQUIREMENTS], start=1):
        try:
            requirement = _requirement(entry)
            # Because files have these names, the case and the kinds of blanks make no difference.
            if requirements.setdefault(requirement.file_name.casefold(), requirement) is not requirement:
                raise ValueError('the name is given twice; must be unique')
        except ValueError as error:
            named = f' {entry["name"]!r:.{MAX_NAME_CHARS}}' if isinstance(entry, dict) and 'name' in entry else ''
            problems.append(f'requirement {number}{named}: {error}')
    if problems:
        raise ValueError('\n'.join(f'{path}: {_cut(problem)}' for problem in problems))
    return Specification(head, tuple(requirements.values()), text)


def _cut(problem: str) -> str:
    """Return a problem without the middle of a long value."""
    half = MAX_PROBLEM_CHARS // 2
    return problem if len(problem) <= MAX_PROBLEM_CHARS else f'{problem[:half]} ... {problem[-half:]}'


def _built(kind: type[_P], section: Mapping[str, Json], *needed: str) -> _P:
    """Return the record of a section, whose texts have one line each. needed: keys of texts that must be given.
    Raises ValueError."""
    found = parameters.build(kind, section)
    for name, value in parameters.as_dict(found).items():
        if isinstance(value, str) and not (len(value) <= MAX_TEXT_CHARS and value.isprintable()):
            raise ValueError(f'{name} = {value!r}: must be a text of one line and at most {MAX_TEXT_CHARS} characters')
        if name in needed and not value:
            raise ValueError(f'{name}: must be given')
    return found


def _requirement(entry: Json) -> Requirement:
    """Return the requirement of an entry. Raises ValueError, which names field, value and allowed range."""
    if not isinstance(entry, dict):
        raise ValueError(f'{entry!r}: must hold the keys {", ".join(parameters.defaults(Entry))}')
    given = entry.pop('arguments', {})
    found = _built(Entry, entry, 'name', 'method', 'limit', 'unit')
    if len(found.name) > MAX_NAME_CHARS:
        raise ValueError(f'name = {found.name!r}: must be a text of 1 to {MAX_NAME_CHARS} characters')
    if found.method not in METHOD_BY_NAME:
        hint = did_you_mean(found.method, METHOD_BY_NAME)
        raise ValueError(f'method = {found.method!r}: unknown;{hint} must be one of {", ".join(METHOD_BY_NAME)}')
    method = METHOD_BY_NAME[found.method]
    if not isinstance(given, dict) or any(isinstance(value, (bool, list, dict)) for value in given.values()):
        raise ValueError(f'arguments = {given!r}: must be a section with a number or text for each argument')
    arguments = commands.values((method,), commands.Command(method.name, arguments={
        name: str(value) for name, value in given.items()}))
    if found.unit != method.unit:
        raise ValueError(f'unit = {found.unit!r}: must be {method.unit!r}, the unit of {method.name}')
    return Requirement(found.name, method, arguments, _limit(method, found.limit), found.repetitions, found.confidence)


def _limit(method: Method, text: str) -> Target:
    """Return the limit of a text. Raises ValueError for a text that is no limit, and for an impossible limit."""
    if not LIMIT_PATTERN.fullmatch(text):
        raise ValueError(f"limit = {text!r}: must be a text as '<= 0.05', '>= 1', '1 +- 0.1' or '1 to 2'")
    limit, words = Target.parse(text), LIMIT_WORDS[method.better]
    if limit.word not in words:
        raise ValueError(f'limit = {text!r}: the limit of {method.name} must have one of the words {", ".join(words)}')
    low, high = limit.ends
    if not low < high or math.isinf(limit.first) or math.isinf(limit.last):
        raise ValueError(f'limit = {text!r}: no value is inside; must have finite numbers, and low below high')
    return limit
