"""Book: the folder of Markdown pages from which `make book` builds the documentation as a web site.

`python -m tools.book FOLDER` copies the pages of the table pages.PAGES and all other files of docs/ into the folder.
It adds two pages generated from the code, in reference/: the options of the verbs, and the laws. CONTRIBUTING.md and
CHANGELOG.md, which are outside docs/, get names in lower case. Each notebook is executed and becomes a page with its
output.
"""
import argparse
import ast
import inspect
import pathlib
import shutil
import sys
from collections.abc import Iterator

from tools import notebooks, pages

from pedestal import cli

LAW_PACKAGES = ('pedestal_common', 'receiver_law', 'drive_law', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive',
                'ship_motion_sim')
"""Packages with laws, in the order of the page of laws."""


def verb_page() -> list[str]:
    """Return the lines of the page of verbs: purpose and options of every verb, as its --help prints them."""
    lines = ['# Options of every verb', '', 'The help texts that `pedestal VERB --help` prints.']
    for name, (_, summary) in cli.VERBS.items():
        verb = cli.found(name)
        parser = argparse.ArgumentParser(prog=f'pedestal {name}', add_help=False,
                                         formatter_class=lambda prog: argparse.HelpFormatter(prog, width=100))
        verb.add_arguments(parser)
        lines += ['', f'## {name}', '', f'{summary[0].upper()}{summary[1:]}.', '',
                  inspect.getdoc(verb.add_arguments) or '', '', '```',
                  *parser.format_help().rstrip().splitlines(), '```']
    return lines


def law_page(root: pathlib.Path) -> list[str]:
    """Return the lines of the page of laws: docstring, compiled functions and tests of every module with laws."""
    lines = ['# Laws', '', 'Every control law, filter, motor and wave is a compiled function in a small module. This '
             'page is a copy of the docstrings of these modules: equations, symbols, sources.']
    for package in LAW_PACKAGES:
        folder = root / 'src' / package
        tests = {test.name: set(_imported(test)) for test in sorted((folder / 'test').glob('test_*.py'))}
        lines += ['', f'## {package}', '', '```text', _docstring(folder / package / '__init__.py'), '```']
        for module in sorted((folder / package).rglob('*.py')):
            laws = _laws(module)
            if laws is not None:
                name = '.'.join(module.relative_to(folder).with_suffix('').parts)
                importing = [test for test, modules in tests.items() if name in modules]
                lines += ['', f'### {name}', '', '```text', _docstring(module), '```', '',
                          *(f'- `{law}`: {first}' for law, first in laws),
                          *([f'- tests: {", ".join(f"`{test}`" for test in importing)}'] if importing else [])]
    return lines


def _docstring(module: pathlib.Path) -> str:
    return ast.get_docstring(ast.parse(module.read_text())) or ''


def _imported(test: pathlib.Path) -> Iterator[str]:
    """Yield the dotted names that a test module imports with `from`."""
    for node in ast.walk(ast.parse(test.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield from (str(node.module), *(f'{node.module}.{alias.name}' for alias in node.names))


def _laws(module: pathlib.Path) -> list[tuple[str, str]] | None:
    """Return [(signature, first paragraph of the docstring)] of the public compiled functions of a module, or None."""
    compiled = [node for node in ast.parse(module.read_text()).body if isinstance(node, ast.FunctionDef) and any(
        ast.unparse(decorator) in ('compiled', 'inlined') for decorator in node.decorator_list)]
    return [(f'{node.name}({", ".join(argument.arg for argument in node.args.args)})',
             ' '.join((ast.get_docstring(node) or '').split('\n\n')[0].split()).replace('<', '&lt;'))
            for node in compiled if not node.name.startswith('_')] if compiled else None


BOOK_ONLY_LINKS = {'docs/reference/commands.md': '[Options of every verb](verbs.md) has the help texts of all verbs.',
                   'docs/understand/architecture.md': '[Laws](../reference/laws.md) has the equations of every law.'}
"""{page: sentence that the book adds at its end}, with the links to the pages that only the book has."""


LAST_IN_SEARCH = '---\nsearch:\n  boost: 0.3\n---\n\n'
"""Head of a page to which the search of the book gives less weight than to the pages that explain."""


def main(folder: str | pathlib.Path, root: str | pathlib.Path = '.', execute: bool = True) -> int:
    """Write all pages of the book of a checkout (root) into a folder, whose old content is deleted. Return the exit
    code 0. execute: True to run the notebooks, whose pages otherwise have no output."""
    root, folder = pathlib.Path(root), pathlib.Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(root / 'docs', folder, ignore=shutil.ignore_patterns('*.md', '__pycache__'))
    present = [page.path for page in pages.PAGES if (root / page.path).is_file()]
    files = {*present, *(str(path.relative_to(root)) for path in (root / 'docs').rglob('*')
                         if path.is_file() and path.suffix != '.md')}
    looked_up = [page.path for page in (*pages.SECTIONS['Develop'], *pages.SECTIONS['Reference'])]
    for path in present:
        place = folder / (pages.book_path(path) or '')
        if path.endswith('.ipynb'):
            notebooks.write_page(notebooks.read(folder / place.with_suffix('.ipynb').name, execute),
                                 place.with_suffix('.ipynb'))
        elif place != folder:
            place.parent.mkdir(parents=True, exist_ok=True)
            added = f'\n{BOOK_ONLY_LINKS[path]}\n' if path in BOOK_ONLY_LINKS else ''
            last = LAST_IN_SEARCH if path in looked_up else ''
            place.write_text(last + pages.for_book((root / path).read_text(), path, files) + added)
    (folder / 'reference').mkdir(exist_ok=True)
    for name, lines in (('verbs', verb_page()), ('laws', law_page(root))):
        (folder / 'reference' / f'{name}.md').write_text('\n'.join((LAST_IN_SEARCH, *lines)) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
