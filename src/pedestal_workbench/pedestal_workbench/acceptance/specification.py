"""Specification of an acceptance: what a contract requires of an antenna, read from a YAML file.

All problems of a file are found before anything moves, and are stated together, a line for each of them.
"""
import hashlib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import yaml

from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import Json
from pedestal_common.text_files import files, plain_yaml
from pedestal_common.text_files.files import FilePath
from pedestal_common.wire import commands
from pedestal_results.intervals import CONFIDENCE_LEVEL, Target
from pedestal_workbench.acceptance.exercise import Exercise, Performer
from pedestal_workbench.acceptance.method import Arguments, Method
from pedestal_workbench.acceptance.methods import METHOD_BY_NAME

HEADER_KEYS = 'title', 'customer', 'antenna', 'tester', 'calibration'
REQUIREMENT_KEYS = 'name', 'method', 'arguments', 'limit', 'unit', 'repetitions', 'confidence'
NEEDED_KEYS = 'name', 'method', 'limit', 'unit'
MAX_REQUIREMENTS, MAX_NAME_CHARS, MAX_TEXT_CHARS = 200, 60, 500     # of a file, of a name, of a text of the header
REPETITION_LIMITS, CONFIDENCE_LIMITS = (1, 100), (0.5, 0.999)
NO_FILE_PATTERN = re.compile(r'[^\w.,()+-]+|^[.-]+')     # parts of the name of a requirement that no file has
_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
LIMIT_PATTERN = re.compile(rf'(?:<=|>=|<|>) {_NUMBER}|{_NUMBER} (?:\+-|to) {_NUMBER}')
LIMIT_WORDS = {'<=': ('<=', '<', '+-', 'to'), '>=': ('>=', '>', '+-', 'to'), '+-': ('+-', 'to')}
"""{Method.better: words of a limit that make sense}."""


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
    title: str
    customer: str
    antenna: str
    tester: str             # name of the person who tests
    calibration: str        # calibration in force, in words
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
                if method.simulated and antenna.adu is None:
                    raise ValueError(f'method = {method.name!r}: needs a simulated drive; this drive is real')
                exercises.append(method.exercise(antenna, requirement.arguments))
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
    if not isinstance(content, dict):
        raise ValueError(f'{path}: must hold the keys requirements, {", ".join(HEADER_KEYS)}')
    content = {**content, 'tester': tester or content.get('tester', '')}
    requirements: dict[str, Requirement] = {}
    problems = list(_header_problems(content))
    entries = content.get('requirements')
    for number, entry in enumerate(entries if isinstance(entries, list) else (), start=1):
        try:
            requirement = _requirement(entry)
            # Because files have these names, the case and the kinds of blanks make no difference.
            if requirements.setdefault(requirement.file_name.casefold(), requirement) is not requirement:
                raise ValueError('the name is given twice; must be unique')
        except ValueError as error:
            named = f' {_short(entry["name"])}' if isinstance(entry, dict) and 'name' in entry else ''
            problems.append(f'requirement {number}{named}: {error}')
    if problems:
        raise ValueError('\n'.join(f'{path}: {problem}' for problem in problems))
    return Specification(**{key: content.get(key, '') for key in HEADER_KEYS},
                         requirements=tuple(requirements.values()), text=text)


def _header_problems(content: Mapping[str, Json]) -> Iterator[str]:
    """Yield a line for each problem of a file outside of its requirements."""
    try:
        _check_keys(content, (*HEADER_KEYS, 'requirements'), ('title', 'requirements'))
    except ValueError as error:
        yield str(error)
    for key in HEADER_KEYS:
        text = content.get(key, '')
        if not isinstance(text, str) or len(text) > MAX_TEXT_CHARS or not text.isprintable():
            yield f'{key} = {_short(text)}: must be a text of one line and at most {MAX_TEXT_CHARS} characters'
    entries = content.get('requirements', [None])
    if not isinstance(entries, list) or not 1 <= len(entries) <= MAX_REQUIREMENTS:
        yield f'requirements = {_short(entries)}: must be a list of 1 to {MAX_REQUIREMENTS} entries'


def _check_keys(section: Mapping[str, Json], known: Sequence[str], needed: Sequence[str]) -> None:
    for key in section:
        if key not in known:
            raise ValueError(f'unknown key {_short(key)};{did_you_mean(key[:MAX_NAME_CHARS], known)} there are '
                             f'{", ".join(known)}')
    for key in needed:
        if section.get(key) is None:
            raise ValueError(f'{key} is missing')


def _requirement(entry: Json) -> Requirement:
    """Return the requirement of an entry. Raises ValueError, which names field, value and allowed range."""
    if not isinstance(entry, dict):
        raise ValueError(f'{_short(entry)}: must hold the keys {", ".join(NEEDED_KEYS)}')
    _check_keys(entry, REQUIREMENT_KEYS, NEEDED_KEYS)
    name, word, given = entry['name'], entry['method'], entry.get('arguments', {})
    if not isinstance(name, str) or not (1 <= len(name) <= MAX_NAME_CHARS and name.isprintable()):
        raise ValueError(f'name = {_short(name)}: must be a text of 1 to {MAX_NAME_CHARS} characters')
    if word not in list(METHOD_BY_NAME):
        hint = did_you_mean(str(word)[:MAX_NAME_CHARS], METHOD_BY_NAME)
        raise ValueError(f'method = {_short(word)}: unknown;{hint} must be one of {", ".join(METHOD_BY_NAME)}')
    method = METHOD_BY_NAME[word]
    if not isinstance(given, dict) or any(isinstance(value, (bool, list, dict)) for value in given.values()):
        raise ValueError(f'arguments = {_short(given)}: must be a section with a number or text for each argument')
    arguments = commands.values((method,), commands.Command(word, arguments={
        name: str(value)[:MAX_TEXT_CHARS] for name, value in given.items()}))
    if entry['unit'] != method.unit:
        raise ValueError(f'unit = {_short(entry["unit"])}: must be {method.unit!r}, the unit of {word}')
    return Requirement(name, method, arguments, _limit(method, entry['limit']),
                       int(_number(entry, 'repetitions', 1, REPETITION_LIMITS, int)),
                       _number(entry, 'confidence', CONFIDENCE_LEVEL, CONFIDENCE_LIMITS, float))


def _limit(method: Method, text: Json) -> Target:
    """Return the limit of a text. Raises ValueError for a text that is no limit, and for an impossible limit."""
    if not isinstance(text, str) or len(text) > MAX_NAME_CHARS or not LIMIT_PATTERN.fullmatch(text):
        raise ValueError(f"limit = {_short(text)}: must be a text as '<= 0.05', '>= 1', '1 +- 0.1' or '1 to 2'")
    limit, words = Target.parse(text), LIMIT_WORDS[method.better]
    if limit.word not in words:
        raise ValueError(f'limit = {text!r}: the limit of {method.name} must have one of the words {", ".join(words)}')
    if math.isinf(limit.first) or math.isinf(limit.last):
        raise ValueError(f'limit = {text!r}: its numbers must be finite')
    if limit.word == '+-' and limit.last <= 0.0 or limit.word == 'to' and limit.first >= limit.last:
        must = 'the second number must be above ' + ('0' if limit.word == '+-' else 'the first')
        raise ValueError(f'limit = {text!r}: no value is inside; {must}')
    return limit


def _number(entry: Mapping[str, Json], key: str, default: float, limits: tuple[float, float],
            kind: type[float]) -> float:
    """Return the number of a key, or its default. Raises ValueError for another value or one outside limits."""
    value: Json = entry.get(key, default)
    if type(value) not in (int, kind) or not limits[0] <= value <= limits[1]:
        raise ValueError(f'{key} = {_short(value)}: must be a {"whole " if kind is int else ""}number from '
                         f'{limits[0]:g} to {limits[1]:g}')
    return float(value)


def _short(value: Json) -> str:
    """Return a value of a file for an error, cut to a readable length."""
    text = repr(value)
    return text if len(text) <= MAX_NAME_CHARS else f'{text[:MAX_NAME_CHARS]}...'
