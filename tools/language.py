"""Check of the language of the documentation and of the docstrings, comments and texts of the code. The test
test/test_language.py uses it.

`python -m tools.language [PATH ...]` prints the texts that break a rule of CONTRIBUTING.md: forbidden words and long
sentences. PATH is a file or a folder. Without PATH it reads README.md, CONTRIBUTING.md, CHANGELOG.md, docs/ and all
modules except the tests.
"""
import ast
import io
import pathlib
import re
import sys
import tokenize
from collections.abc import Iterator, Sequence
from typing import TypeAlias

from tools import pages

Text: TypeAlias = tuple[int, str, bool]     # line number, text, True if it consists of sentences
Fault: TypeAlias = tuple[int, str, str]     # line number, broken rule, text

MAX_SENTENCE_WORDS = 35
FORBIDDEN_WORD = re.compile(r'\b(told|tells|says|asked|anew|strangers?|whoever|somebody|nobody|hearers?|'
                            r'listeners?|held up|moves unasked|parted|spoil(?:s|ed)?)\b', re.IGNORECASE)
"""Words that the rules of the language forbid: words with which machines speak, words for actors without a name, and
words that a term of docs/glossary.md replaces (subscriber, stall, uncommanded motion, mismatch, inject)."""

ALLOWED = {  # {(path, part of a text): reason why that text may break a rule}
    ('src/pedestal_studies/pedestal_studies/p002_jia/compared_loops.py', 'best-told-10ms-less'):
        'a case of --json, which programs read',
    ('tools/language.py', 'told|tells'): 'the list of the forbidden words itself',
    ('tools/language.py', 'best-told-10ms-less'): 'the exception of the case above',
}

CONSTANT_NAME = re.compile(r'[A-Z][A-Z0-9_]*')
ROOT = pathlib.Path(__file__).parents[1]
_SENTENCE_END = re.compile(r'(?<=[.!?;])["\')`*]*\s+(?=["\'(`*\[]*[A-Z0-9`])')
_ABBREVIATION = re.compile(r'\b(e\.g|i\.e|cf|eq|Eq|fig|Fig|sec|Sec|vs|approx|No|St|resp)\.\s')
_TABLE_ROW = re.compile(r'^\s+\S|\S {2,}\S|^\s*[|>]|^\s*$')


def paths() -> list[pathlib.Path]:
    """Return every file whose language is checked."""
    pages = (ROOT / name for name in ('README.md', 'CONTRIBUTING.md', 'CHANGELOG.md'))
    modules = (path for folder in ('src', 'tools') for path in sorted((ROOT / folder).glob('**/*.py')))
    return [*pages, *sorted((ROOT / 'docs').glob('**/*.md')),
            *(path for path in modules if 'test' not in path.parts and path.name != 'setup.py')]


def markdown_texts(text: str) -> Iterator[Text]:
    """Yield each paragraph, heading and table cell of a Markdown page, without its code and comments."""
    def blank(match: re.Match[str]) -> str:     # keeps line numbers
        return '\n' * match[0].count('\n')

    text = pages.CODE_PATTERN.sub(blank, text)
    text = re.sub(r'(?s)<!--.*?-->', blank, text)
    paragraph: list[str] = []
    start, after_blank = 0, True
    for number, line in enumerate([*text.split('\n'), ''], 1):
        item = re.match(r'\s*([-*+]|\d+\.)\s', line)
        code = line.startswith('    ') and after_blank and not item
        ends = not line.strip() or line.lstrip().startswith(('|', '#', '!')) or item or code
        if ends and paragraph:
            yield start, ' '.join(paragraph), True
            paragraph = []
        if line.lstrip().startswith(('|', '#')):
            yield from ((number, cell, False) for cell in line.strip('|# ').split('|'))
        elif line.strip() and not code and not line.lstrip().startswith('!'):
            start = start if paragraph else number
            paragraph.append(line[item.end():] if item else line.strip())
        after_blank = not line.strip() or code


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield (line number, docstring) of a module, its classes, functions and constants."""
    for node in ast.walk(tree):
        for child in () if isinstance(node, (ast.Lambda, ast.IfExp)) else getattr(node, 'body', ()):
            match child:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    yield child.lineno, text


def python_texts(source: str) -> Iterator[Text]:
    """Yield the docstrings, comments and string constants of a module."""
    tree = ast.parse(source)
    documented = dict(docstrings(tree))
    for start, text in documented.items():
        paragraph: list[str] = []
        first = start
        for number, line in enumerate([*text.split('\n'), ''], start):
            indented = number > start and len(line) - len(line.lstrip(' ')) > _indent(text)
            if indented or _TABLE_ROW.search(line.strip() or '') or not line.strip():
                if paragraph:
                    yield first, ' '.join(paragraph), True
                    paragraph = []
                yield number, line, False
            else:
                first = first if paragraph else number
                paragraph.append(line.strip())
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.lineno not in documented:
            yield node.lineno, node.value, False
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string, False


def _indent(text: str) -> int:
    """Return the number of spaces before the text of a docstring, below its first line."""
    lines = [line for line in text.split('\n')[1:] if line.strip()]
    return min((len(line) - len(line.lstrip()) for line in lines), default=0)


def sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph. Inline code becomes one word each, and links lose their address."""
    text = re.sub(r'\]\([^)]*\)', ']', re.sub(r'`[^`]*`', '`x`', text))
    return _SENTENCE_END.split(_ABBREVIATION.sub(r'\1 ', text))


def faults(path: pathlib.Path) -> Iterator[Fault]:
    """Yield each text of a file that breaks a rule."""
    source = path.read_text(encoding='utf-8')
    for line, text, prose in (python_texts if path.suffix == '.py' else markdown_texts)(source):
        for word in FORBIDDEN_WORD.findall(re.sub(r'`[^`]*`', '', text)):
            yield line, f'word {word!r}', text.strip()
        for sentence in sentences(text) if prose else ():
            if len(sentence.split()) > MAX_SENTENCE_WORDS:
                yield line, f'{len(sentence.split())} words', sentence


def allowed(path: pathlib.Path) -> list[str]:
    """Return the parts of texts that ALLOWED lists for a file, and that may therefore break a rule."""
    return [part for name, part in ALLOWED if path.resolve() == ROOT / name]


def broken_rules(path: pathlib.Path) -> list[Fault]:
    """Return the faults of a file without the exceptions of ALLOWED."""
    parts = allowed(path)
    return [fault for fault in faults(path) if not any(part in fault[2] for part in parts)]


def public_constants(path: pathlib.Path) -> list[str]:
    """Return the names of the public constants of a module."""
    targets: list[ast.expr | None] = []
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        for target in node.targets if isinstance(node, ast.Assign) else [getattr(node, 'target', None)]:
            targets += target.elts if isinstance(target, ast.Tuple) else [target]
    return [target.id for target in targets if isinstance(target, ast.Name) and CONSTANT_NAME.fullmatch(target.id)]


def main(names: Sequence[str]) -> int:
    """Print the broken rules of the named files and folders, or of all files. Return 1 if a rule is broken, else 0."""
    named = [pathlib.Path(name).resolve() for name in names]
    missing = [str(path) for path in named if not path.exists()]
    if missing:
        sys.exit(f'no such file or folder: {", ".join(missing)}')
    chosen = [path for path in paths() if any(path.is_relative_to(folder) for folder in named)] if named else paths()
    files = sorted({*chosen, *filter(pathlib.Path.is_file, named)})
    broken = [f'{path}:{line}: {rule}: {text[:200]}' for path in files
              for line, rule, text in broken_rules(path)]
    print(*broken, sep='\n')
    constants = [name for path in paths() if path.suffix == '.py' for name in public_constants(path)]
    short = sum('_' not in name for name in constants)
    print(f'{len(broken)} faults; {short} of {len(constants)} public constants are one word')
    return min(len(broken), 1)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
