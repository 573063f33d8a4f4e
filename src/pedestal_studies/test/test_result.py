"""Every figure of a study: a legend that covers no curve, lines that differ in grey, plain numbers."""
import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pedestal_results.report import figures
from pedestal_studies.result import legend, save

T = np.linspace(0.1, 1.0, 50)


def sheet():
    figure, axes = figures.new_panels(2, height=4.6)
    for panel in axes[:, 0]:
        for colour, label in ((figures.FILTERED_COLOUR, 'a'), (figures.TRUTH_COLOUR, 'b'),
                              (figures.MOTOR_2_COLOUR, 'a much longer name')):
            panel.loglog(T, 3.0 * T, color=colour, label=label)
    return legend(figure)


def test_the_legend_is_outside_of_every_panel_and_names_a_line_once():
    with matplotlib.rc_context(figures.MATPLOTLIB_STYLE):
        figure = sheet()
        FigureCanvasAgg(figure).draw()
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ['a', 'b', 'a much longer name']
    box = legend.get_window_extent()
    assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1
    assert not any(box.overlaps(axes.get_tightbbox()) for axes in figure.axes)


def test_lines_differ_by_more_than_their_colour():
    figure = sheet()
    figures.tidy(figure)
    styles = [line.get_linestyle() for line in figure.axes[0].get_lines()]
    dashes = [line._unscaled_dash_pattern for line in figure.axes[0].get_lines()]
    assert len({str(dash) for dash in dashes}) == 3 and styles[0] == '-'


def test_a_scale_of_one_decade_has_plain_numbers():
    figure = sheet()
    figures.tidy(figure)
    FigureCanvasAgg(figure).draw()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert '0.5' in labels and '2' in labels
    assert not any(label.get_text() for label in figure.axes[0].get_yticklabels(minor=True))


@pytest.mark.parametrize('kind, begins', [('png', b'\x89PNG'), ('pdf', b'%PDF'), ('svg', b'<?xml')])
def test_every_format_is_the_same_bytes_again(tmp_path, kind, begins):
    paths = [tmp_path / folder / f'sheet.{kind}' for folder in ('a', 'b')]
    for path in paths:
        path.parent.mkdir()
        save(sheet, path)
    first, second = (path.read_bytes() for path in paths)
    assert first == second and first.startswith(begins)
