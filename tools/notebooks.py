"""Notebooks as pages of the book: the text, the code, and the output of each cell as Markdown."""
import base64
import pathlib
import tempfile

import nbclient
import nbformat

CELL_TIME_S = 1200  # largest time of a cell [s]; the first cell compiles the laws if they are not cached


def read(path: pathlib.Path, execute: bool) -> nbformat.NotebookNode:
    """Return the notebook of a file; execute: True to run its cells, so that it holds their output."""
    notebook = nbformat.read(path, as_version=4)     # type: ignore[no-untyped-call]     # nbformat has no types here
    if execute:
        with tempfile.TemporaryDirectory() as folder:
            nbclient.NotebookClient(notebook, timeout=CELL_TIME_S, kernel_name='python3',
                                    resources={'metadata': {'path': folder}}).execute()
    return notebook


def write_page(notebook: nbformat.NotebookNode, path: pathlib.Path) -> None:
    """Write the Markdown page of a notebook beside its file `path`, and each figure as a PNG file."""
    parts, figures = [], 0
    for cell in notebook.cells:
        if cell.cell_type == 'markdown':
            parts.append(cell.source)
            continue
        parts.append(f'```python\n{cell.source}\n```')
        for output in cell.outputs:
            data = output.get('data', {})
            if 'image/png' in data:
                figures += 1
                figure = path.with_name(f'{path.stem}_{figures}.png')
                figure.write_bytes(base64.b64decode(data['image/png']))
                parts.append(f'![figure {figures}]({figure.name})')
            elif 'text/plain' in data or output.get('name') == 'stdout':
                parts.append(f'```text\n{data.get("text/plain", output.get("text", "")).rstrip()}\n```')
    parts.append(f'This page is the output of [a notebook]({path.name}), which you can run yourself.')
    path.with_suffix('.md').write_text('\n\n'.join(parts) + '\n')
