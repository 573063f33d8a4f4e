"""Book: the folder of Markdown pages from which `make book` builds the documentation as a web site.

`python -m tools.book FOLDER` copies docs/ into the folder. It adds three pages generated from the code, in reference/:
the parameters of every node, the verbs, the laws. CONTRIBUTING.md, which is outside docs/, becomes contributing.md.
Each notebook is executed and becomes a page with its output.
"""
import argparse
import ast
import inspect
import pathlib
import re
import shutil
import sys
from collections.abc import Iterator

from tools import notebooks

from pedestal import cli
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.graph_parameters import GraphParameters

LAW_PACKAGES = ('pedestal_common', 'receiver_law', 'drive_law', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive',
                'ship_motion_sim')
"""Packages with laws, in the order of the page of laws."""


def parameter_page() -> list[str]:
    """Return the lines of the page of parameters."""
    lines = ['# Parameters', '', 'Every parameter of every node, as the node declares it. `pedestal parameters NODE` '
             'prints the same. The units are SI units and radians. A name that ends in `_deg` or `_dbhz` has this '
             'unit instead.']
    kinds = {node: parameters_of(node) for node in
             ('scenario', *(node.name for node in nodes.NODES if node.program), 'beam_steering')}
    for node, kind in {**kinds, 'graph, of every node': GraphParameters}.items():
        values = parameters.defaults(kind)
        lines += ['', f'## {node}', '', '| parameter | default | range | unit | meaning |', '|---|---|---|---|---|']
        for name, field in parameters.flatten(kind):
            meta, value = field.metadata, values[name]
            allowed = f'{meta["low"]:g} to {meta["high"]:g}' if 'low' in meta else ', '.join(meta.get('options', ()))
            cells = (f'`{name}`', parameters.value_text(value), allowed, meta.get('unit', ''), meta['doc'])
            lines.append('| ' + ' | '.join(cell.replace('|', '\\|') for cell in cells) + ' |')
    return lines


def verb_page() -> list[str]:
    """Return the lines of the page of verbs, as their --help prints them."""
    lines = ['# Verbs', '', 'The help texts that `pedestal VERB --help` prints.']
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


def contributing_page(root: pathlib.Path) -> str:
    """Return CONTRIBUTING.md for the book, whose links to files outside docs/ become plain text."""
    text = (root / 'CONTRIBUTING.md').read_text().replace('](docs/', '](')
    return re.sub(r'\[([^]]*)\]\([A-Z][^)]*\)', r'\1', text)


def main(folder: str | pathlib.Path, root: str | pathlib.Path = '.', *, execute: bool = True) -> int:
    """Write all pages of the book of a checkout into a folder, whose old content is deleted. Return exit code 0.

    execute: True to run the notebooks, whose pages otherwise have no output.
    """
    root, folder = pathlib.Path(root), pathlib.Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(root / 'docs', folder)
    (folder / 'contributing.md').write_text(contributing_page(root))
    for page in folder.glob('*.md'):
        text = page.read_text().replace('](../CONTRIBUTING.md)', '](contributing.md)')
        page.write_text(text.replace('.ipynb)', '.md)'))
    for notebook in sorted(folder.glob('*.ipynb')):
        notebooks.write_page(notebooks.read(notebook, execute), notebook)
    (folder / 'reference').mkdir()
    for name, lines in (('parameters', parameter_page()), ('verbs', verb_page()), ('laws', law_page(root))):
        (folder / 'reference' / f'{name}.md').write_text('\n'.join(lines) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
