"""The rules of language that a program can check (CONTRIBUTING.md): words, length of sentences, names of constants."""
import argparse

import pytest
from tools import language

from pedestal import cli

pytestmark = pytest.mark.every_case


def fault(tmp_path, name, text):
    """Return the rules that a text breaks, as a file of a name."""
    path = tmp_path / name
    path.write_text(text)
    return [rule for _line, rule, _text in language.faults(path)]


LONG = 'A sentence of many words ' + 'that goes on and on ' * 7 + 'ends here.'


@pytest.mark.parametrize('name, text, broken', [
    ('page.md', 'The node told the drive.', ["word 'told'"]),
    ('page.md', '| a cell | somebody |', ["word 'somebody'"]),
    ('page.md', LONG, ['42 words']),
    ('page.md', f'- An item.\n- {LONG}', ['42 words']),
    ('page.md', f'```\n{LONG} told\n```\n', []),
    ('page.md', f'Text:\n\n    {LONG} told\n', []),
    ('page.md', '`asked` is a column.', []),
    ('module.py', '"""Return whoever speaks."""', ["word 'whoever'"]),
    ('module.py', 'A = 1\n"""A constant that tells."""', ["word 'tells'"]),
    ('module.py', f'def f():\n    """{LONG}"""', ['42 words']),
    ('module.py', f'class A:\n    """A class.\n\n    name    {LONG}\n    """', []),
    ('module.py', 'f(help="says nothing")', ["word 'says'"]),
    ('module.py', 'pass  # begins anew', ["word 'anew'"]),
])
def test_the_checker_finds_what_breaks_a_rule(tmp_path, name, text, broken):
    assert fault(tmp_path, name, text) == broken


@pytest.mark.parametrize('path', language.paths(), ids=lambda path: str(path.relative_to(language.ROOT)))
def test_a_file_keeps_the_rules(path):
    assert language.broken_rules(path) == []


@pytest.mark.parametrize('name, part', language.ALLOWED)
def test_an_exception_is_needed_and_has_a_reason(name, part):
    assert any(part in text for _line, _rule, text in language.faults(language.ROOT / name))
    assert len(language.ALLOWED[name, part].split()) > 3


def parsers(parser):
    """Yield a parser and those of its subcommands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for child in action.choices.values():
                yield from parsers(child)


def test_the_help_of_every_verb_keeps_the_rules(tmp_path):
    found = {}
    for parser in parsers(cli._parser()):
        texts = [parser.description or '', *(action.help or '' for action in parser._actions)]
        for number, text in enumerate(texts):
            if broken := fault(tmp_path, f'{number}.md', text):
                found[parser.prog, text] = broken
    assert found == {}


def test_few_public_constants_are_one_word():
    names = [name for path in language.paths() if path.suffix == '.py' for name in language.public_constants(path)]
    assert sum('_' not in name for name in names) < len(names) / 3
