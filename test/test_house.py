"""The rooms of the packages: rooms import each other one way only; few values have no type."""
import ast
import collections
import graphlib
import pathlib
import re
import tokenize

import pytest

pytestmark = pytest.mark.every_case

SOURCES = pathlib.Path(__file__).parents[1] / 'src'
MAX_UNTYPED = 50
MAX_SHARE = 0.25
FILES = {'.'.join(path.relative_to(package).with_suffix('').parts).removesuffix('.__init__'): path
         for package in SOURCES.iterdir() for path in (package / package.name).rglob('*.py')}


def imported(path):
    """Return the names of our modules that a file imports, inside functions too, but not those for types alone."""
    names, tree = set(), ast.parse(path.read_text())
    for_types = {node for block in ast.walk(tree)
                 if isinstance(block, ast.If) and ast.unparse(block.test).endswith('TYPE_CHECKING')
                 for one in block.body for node in ast.walk(one)}
    for node in set(ast.walk(tree)) - for_types:
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            names.update(f'{node.module}.{alias.name}' if f'{node.module}.{alias.name}' in FILES else node.module
                         for alias in node.names)
    return names & FILES.keys()


def room(module):
    """Return the folder that a module is in; a module at the top of its package is a room of its own."""
    parent = module.rpartition('.')[0]
    return module if FILES[module].stem == '__init__' or '.' not in parent else parent


def test_few_values_have_no_type_and_each_has_a_reason():
    """The reason is a comment on the line of `Any`, or of `type: ignore`."""
    found = []
    for path in FILES.values():
        if not re.search(r'\bAny\b|type: ignore', path.read_text()):
            continue
        words = collections.defaultdict(list)
        with path.open('rb') as file:
            for token in tokenize.tokenize(file.readline):
                words[token.start[0]].append(token)
        for line, tokens in words.items():
            comment = ''.join(token.string for token in tokens if token.type == tokenize.COMMENT)
            code = [token.string for token in tokens if token.type != tokenize.COMMENT and token.string.strip()]
            named = code[:1] not in (['from'], ['Any']) and any(        # an import names no value
                word == 'Any' and (before != '.' or owner == 'typing')
                for owner, before, word in zip(['', ''] + code, [''] + code, code))
            if named or 'type: ignore' in comment:
                found.append((f'{path.relative_to(SOURCES)}:{line}', comment.partition('ignore')[2] or comment))
    assert [place for place, reason in found if len(reason.split()) < 3] == []
    assert len(found) <= MAX_UNTYPED

@pytest.mark.parametrize('package', sorted(path.name for path in SOURCES.iterdir()))
def test_rooms_have_no_circle(package):
    arrows = collections.defaultdict(set)
    for module, path in FILES.items():
        if module.partition('.')[0] == package:
            arrows[room(module)] |= {room(name) for name in imported(path) if name.startswith(package)}
    for name, others in arrows.items():
        others.discard(name)
    graphlib.TopologicalSorter(arrows).prepare()    # raises CycleError, which names the circle


def test_no_package_holds_more_than_a_quarter():
    lines = collections.Counter()
    for module, path in FILES.items():
        lines[module.partition('.')[0]] += path.read_text().count('\n')
    assert max(lines.values()) <= MAX_SHARE * lines.total(), lines
