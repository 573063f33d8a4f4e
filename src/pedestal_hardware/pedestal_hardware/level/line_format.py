"""The level in a line of text, by a format string such as `{level} dBm` or `$SIG,{skip},{level:x}`.

    {level}      a decimal number
    {level:x}    a hexadecimal number with a sign
    {skip}       any text without comma, semicolon and space, also none

A space in the format stands for one or more spaces; every other character stands for itself.
"""
import re
import string

from pedestal_common.parameters import ParameterError

FIELD_PATTERNS = {('level', ''): r'(?P<level>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?|[+-]?(?:nan|inf\w*))',
                  ('level', 'x'): r'(?P<level>[+-]?[0-9a-fA-F]{1,15})', ('skip', ''): r'[^,;\s]*'}

FIELDS_TEXT = '{level}, {level:x} or {skip}'  # the fields, for texts
SEPARATORS = ',; '  # characters of which one follows {skip}. The match is therefore never ambiguous and never slow.


class LineFormat:
    """A format string. Raises ParameterError, which names the wrong field."""

    def __init__(self, text: str) -> None:
        self.text, self._hexadecimal = text, False
        try:
            parts = list(string.Formatter().parse(text.strip()))
        except ValueError as error:
            raise self._error(f'{error}; fields are {FIELDS_TEXT}') from None
        pattern, levels = '', 0
        for (literal, name, form, conversion), after in zip(parts, [*parts[1:], None]):
            pattern += r'\s+'.join(map(re.escape, re.split(r'\s+', literal)))
            if name is None:
                continue
            field = f'field {{{name}' + (f'!{conversion}' if conversion else '') + (f':{form}' if form else '') + '}'
            if form is None or (name, form) not in FIELD_PATTERNS or conversion:
                raise self._error(f'{field}: must be {FIELDS_TEXT}')
            if after and (not after[0] or name == 'skip' and after[0][0] not in SEPARATORS):
                raise self._error(f'{field}: must be followed by a comma, a semicolon, a space or the end')
            pattern += FIELD_PATTERNS[name, form]
            levels += name == 'level'
            if levels > 1:
                raise self._error(f'{field}: must occur once')
            self._hexadecimal |= form == 'x'
        if not levels:
            raise self._error('field {level}: is missing')
        self._pattern = re.compile(pattern, re.ASCII | re.IGNORECASE)

    def _error(self, reason: str) -> ParameterError:
        return ParameterError(f"format = '{self.text}': {reason}")

    def level(self, line: bytes) -> float:
        """Return the number in a line, also NaN or infinite. Raises ValueError for a line of another form."""
        match = self._pattern.fullmatch(line.decode('ascii', 'replace').strip())
        if match is None:
            raise ValueError(f'{line[:40]!r} is not of the form {self.text}')
        return float(int(match['level'], 16)) if self._hexadecimal else float(match['level'])
