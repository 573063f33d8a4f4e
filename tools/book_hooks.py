"""Hooks of mkdocs (mkdocs.yml): the navigation of the book, and changes of the HTML of a page."""
import re

from tools import pages


def on_config(config):
    """Return the configuration with the navigation of the table of the pages."""
    config.nav = pages.nav(config.docs_dir)
    return config


def on_page_content(html: str, **_context: object) -> str:
    """Return the HTML of a page whose long names in tables may break after a dot, a slash or an underscore."""
    return re.sub(r'(?s)<td.*?</td>', lambda cell: re.sub(r'<code>.*?</code>', _breakable, cell[0]), html)


def _breakable(code: re.Match[str]) -> str:
    """Return the code of a match with the places where a line may break."""
    return re.sub(r'(?<=\w)([./_])(?=\w)', r'\1<wbr>', code[0].removesuffix('</code>')) + '</code>'
