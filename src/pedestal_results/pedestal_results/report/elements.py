"""HTML elements of report pages: numbers, figures, and the page as one self-contained file."""
import html
import io
import math
from collections.abc import Iterable

from pedestal_results.report import figures

PAGE_CSS = """
:root { color-scheme: light dark; --ink: #20242a; --soft: #626a75; --line: #d5dae0; --paper: #ffffff; --bad: #b3261e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #dfe3e8; --soft: #9aa3ae; --line: #3a414a; --paper: #16191d; --bad: #ff8a80; } }
@media print {
  :root { color-scheme: light; --ink: #000000; --soft: #444444; --line: #bbbbbb; --paper: #ffffff; --bad: #b3261e; }
  figure, tr { break-inside: avoid; } body { padding: 0; max-width: none; } }
body { margin: 0 auto; padding: 1.2rem; max-width: 60rem; color: var(--ink); background: var(--paper);
       font: 1rem/1.45 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 .4rem; padding-top: .8rem; border-top: 1px solid var(--line); }
p, figcaption { margin: .3rem 0; } .soft, figcaption { color: var(--soft); font-size: .92rem; }
.bad { color: var(--bad); font-weight: 600; } .verdict { font-size: 1.15rem; font-weight: 600; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0; font-size: .95rem; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem 1.4rem .22rem 0; text-align: left; vertical-align: top;
         border-bottom: 1px solid var(--line); }
th { font-weight: 600; } tbody th { font-weight: 400; } td.n, th.n { text-align: right; }
.n tbody th { min-width: 8rem; }
.meta th { color: var(--soft); } .meta td { overflow-wrap: anywhere; }
figure { margin: 0 0 1.4rem; } figure h3 { font-size: 1rem; margin: 1.2rem 0 .1rem; }
figure svg { display: block; width: 100%; height: auto; min-width: 26rem; }
@media (max-width: 40rem) {
  body { padding: .6rem; } th, td { padding-right: .7rem; } .n tbody th { min-width: 6rem; } }
"""


def page(title: str, parts: Iterable[str], css: str = '') -> str:
    """Return the text of an HTML page; parts: its elements as texts; css: rules beside those of every page."""
    return ('<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<title>{html.escape(title)}</title><style>{PAGE_CSS}{css}</style></head>\n<body>\n'
            + '\n'.join(parts) + '\n</body></html>\n')


def figure(spec: figures.Spec, data: object, reason: str = '') -> str:
    """Return a figure as an HTML element with title and caption; reason: why it cannot be drawn, or ''."""
    caption = f'<h3>{html.escape(spec.title)}</h3>'
    if reason:
        return f'<figure id="{spec.key}">{caption}<p class="bad">Not drawn: {html.escape(reason)}.</p></figure>'
    stream = io.StringIO()
    figures.render(spec, data, stream)
    return (f'<figure id="{spec.key}">{caption}<figcaption>{html.escape(spec.caption)}</figcaption>'
            f'<div class="wide">{figures.inline(stream.getvalue())}</div></figure>')


def number(value: float, unit: str = '') -> str:
    """Return a value with its unit as text."""
    text = f'{value:#.4g}'.rstrip('.') if math.isfinite(value) else 'not measured'
    return f'{text}\N{NO-BREAK SPACE}{unit}'.rstrip() if math.isfinite(value) else text
