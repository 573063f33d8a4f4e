"""Reader of the numbers in the lines of rotator programs."""
import re


def number(text: str) -> float:
    """Return the number in a text, which is finite and has a decimal point or a decimal comma. Raises ValueError."""
    if not re.fullmatch(r'[+-]?([0-9]{1,9}([.,][0-9]*)?|[.,][0-9]+)(e[+-]?[0-9]{1,2})?', text, re.IGNORECASE):
        raise ValueError(f'{text!r} is not a number')
    return float(text.replace(',', '.'))
