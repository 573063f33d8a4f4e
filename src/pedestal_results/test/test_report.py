import html.parser
import io
import math
import pathlib
import re
import shutil

import numpy as np
import pytest

from pedestal import cli
from pedestal_common.graph import topics
from pedestal_common.wire import commands, messages
from pedestal_recording import bag as bags
from pedestal_recording.writer import Writer
from pedestal_results import consistency, results, tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report import figures, filter_figures, run_figures
from pedestal_results.report.page import write as write_report

REFERENCES = pathlib.Path(__file__).parents[3] / 'bags' / 'reference'
T = 5_000_000
STEPS = 1000
NOISE = math.radians(0.03)
TWIST = 0.001
"""Of the dish off the azimuth encoder [rad]."""

ASHORE = ('clock', 'joint_states', 'adu/truth', 'adu/motor_states', 'tracking_receiver/angle_error', 'target/truth',
          'acu/estimate', 'acu/filter', 'acu/mode', 'diagnostics')


def stamped(message, k):
    messages.put_stamp(message.header.stamp, k * T)
    return message


def step(k, rng, locked=True, effort=True):
    """{topic: message} of step k: a target that crosses south of the zenith through azimuth 180 deg."""
    azimuth, elevation = math.pi + 0.1 * (k - STEPS / 2) * T * 1e-9, 0.8
    truth, joints = messages.template('adu/truth'), messages.template('joint_states')
    truth.position[:] = azimuth - 0.0002 * math.sin(0.05 * k), elevation - 0.0001
    joints.position[:] = truth.position[0] - TWIST, truth.position[1]
    joints.effort[:] = 100.0, 50.0
    if not effort:
        joints.effort = np.zeros(0)
    motors = messages.template('adu/motor_states')
    motors.effort[:] = 15.0, -9.0, 13.0, -11.0
    target = messages.template('target/truth')
    at = target.pose.pose.position
    at.x, at.y, at.z = (1000.0 * f for f in (math.sin(azimuth) * math.cos(elevation),
                                             math.cos(azimuth) * math.cos(elevation), math.sin(elevation)))
    noise = NOISE * rng.standard_normal(2)
    error = messages.Vector3Stamped(header=messages.header('beam'), vector=messages.vector3(
        0.0002 * math.sin(0.05 * k) * math.cos(elevation) + noise[0] if locked and k >= 40 else math.nan,
        0.0001 + noise[1] if locked and k >= 40 else math.nan, 45.0))
    estimate = messages.template('acu/estimate')
    [point] = estimate.points
    point.positions[:] = azimuth + 0.1 * noise[0], elevation + 0.1 * noise[1]
    point.velocities[:] = 0.1 + 0.01 * noise[0], 0.01 * noise[1]
    told = messages.template('acu/filter')
    told.position[:] = [value for nu in noise for value in (
        nu, math.nan, (nu / NOISE)**2, 0.1 * NOISE, 0.02 * NOISE, 0.0, NOISE, 0.3, 0.3, math.nan, 0.4,
        *[math.nan] * (len(topics.MOTION_MODELS) - 4))]
    made = {'joint_states': joints, 'adu/truth': truth, 'acu/filter': told, 'adu/motor_states': motors,
            'target/truth': target, 'tracking_receiver/angle_error': error, 'acu/estimate': estimate}
    return {name: stamped(message, k) for name, message in made.items()}


def status(k, node, level, text):
    return stamped(messages.DiagnosticArray(header=messages.header(''), status=[messages.DiagnosticStatus(
        level=level, name=node, message=text, hardware_id='pedestal', values=[])]), k)


def events_of(k):
    """[(topic, message)] of step k: commands with their senders, an injected fault and the alarm that it causes."""
    replied = {100: ('acu/command_result', 'track', 'Ada', {}, True, 'mode is track'),
               101: ('acu/command_result', 'preset', 'scenario', {'azimuth': '9'}, False, 'refused: outside limits'),
               400: ('adu/injected', 'motor_loss', 'Ada', {'axis': 'azimuth', 'duration': '1.5'}, True, 'injected')}
    values = {'state': 'unacknowledged', 'priority': 'high', 'detail': 'azimuth motor 1', 'raised_s': '2.050'}
    alarm = messages.DiagnosticStatus(
        level=2, name='motor_fault', message='a motor is off', hardware_id='acu',
        values=[messages.KeyValue(key=key, value=value) for key, value in values.items()])
    changes = {410: [alarm], 710: []}
    made = []
    if k in replied:
        topic, verb, who, arguments, granted, text = replied[k]
        made.append((topic, commands.reply_message(commands.Command(verb, who, '1', arguments),
                                                   commands.Reply(granted, text))))
    if k in changes:
        made.append(('acu/alarms', messages.DiagnosticArray(header=messages.header(''), status=changes[k])))
    return made


def make_bag(path, names=ASHORE, steps=STEPS, locked=True, skip=(), effort=True, **metadata):
    """A bag of a short run with some of the topics."""
    kept = [topics.TOPIC_BY_NAME[name] for name in names]
    writer = Writer(path, kept, {'scenario': 'short <run>', 'pacing': 'lockstep', 'seed': 3, **metadata})
    rng = np.random.default_rng(1)

    def put(name, k, message, late=0):
        if name in names:
            writer.write(names.index(name), k * T, k * T + late, messages.serialize(message))

    for k in range(steps):
        if k in (0, 50):
            put('acu/mode', k, messages.String(data='autotrack' if k and locked else 'program'))
        if k % 200 == 0:
            put('diagnostics', k, status(k, 'adu', 0, 'following'))
            put('diagnostics', k, status(k, 'tracking_receiver', 0, 'locked'))
            put('diagnostics', k, status(k, 'acu', int(k < 400), 'waits for <lock> & more'))
        clock = messages.Clock(clock=messages.Time(sec=0, nanosec=0))
        messages.put_stamp(clock.clock, k * T)
        put('clock', k, clock)
        for name, message in events_of(k):
            put(name, k, message)
        for name, message in step(k, rng, locked, effort).items():
            if k not in skip:
                put(name, k, message, late=(k % 2) * 1_000_000)
    writer.close()
    return path


class Page(html.parser.HTMLParser):
    """Ids of the page, its tables as rows of texts, tags left open, and addresses it would fetch."""

    VOID = ('meta', 'br', 'link', 'img')

    def __init__(self, text):
        super().__init__()
        self.ids, self.rows, self.open, self.text, self.links, self.drawn = [], {}, [], '', [], []
        self._row, self._figure = [], ''
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if 'id' in attributes and tag in ('h2', 'figure'):
            self.ids.append(attributes['id'])
        if tag == 'figure':
            self._figure = attributes['id']
        if tag == 'svg':
            self.drawn.append(self._figure)
        if tag == 'tr':
            self._row = []
        if tag in ('td', 'th'):
            self._row.append('')
        self.links += [value for name, value in attributes.items() if name in ('src', 'href', 'xlink:href')]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag == 'tr':
            self.rows[self._row[0]] = self._row[1:]

    def handle_data(self, data):
        self.text += data
        if self.open and self.open[-1] in ('td', 'th'):
            self._row[-1] += data


def page_of(bag, **options):
    return Page(write_report(bag, **options).read_text())


@pytest.fixture
def texts_only(monkeypatch):
    """For tests of texts and tables: every figure is made, and none is rendered, which takes most of the time."""
    monkeypatch.setattr(figures, 'store', lambda figure, output, dpi: output.write('<svg></svg>'))


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    return make_bag(tmp_path_factory.mktemp('report') / 'whole')


@pytest.fixture(scope='module')
def page(whole, tmp_path_factory):
    folder = tmp_path_factory.mktemp('png')
    return page_of(whole, output=folder / 'sub' / 'r.html', png_folder=folder), folder


def test_every_figure_and_section_is_there(page):
    page, folder = page
    keys = [spec.key for spec in (*run_figures.FIGURES, *filter_figures.FIGURES)]
    assert page.drawn == keys
    assert {'parameters', 'events', 'results', 'figures', 'filter', 'diagnostics', *keys} <= set(page.ids)
    assert page.open == []
    assert 'of the paper' not in page.text
    assert sorted(path.name for path in folder.glob('*.png')) == sorted(f'{key}.png' for key in (*keys, 'overview'))
    for path in folder.glob('*.png'):
        assert path.read_bytes()[:8] == b'\x89PNG\r\n\x1a\n'


def test_file_needs_nothing_else(page):
    page, folder = page
    assert page.links and all(link.startswith('#') for link in page.links)
    text = (folder / 'sub' / 'r.html').read_text()
    assert 'http' not in text and '@import' not in text and '<script' not in text
    assert text.count('url(') == text.count('url(#')


def test_numbers_are_those_of_the_summary(page, whole):
    parts = tracking.read(bags.read(whole)).parts
    values = {key: value for key, (value, _) in results.measured(parts).items()}
    rows = page[0].rows

    def read(name):
        return [float(cell.split()[0]) for cell in rows[name] if cell]

    def near(*keys, scale=1.0):
        return pytest.approx([values[key] / scale for key in keys], rel=6e-4)

    rms = ('cross_elevation_rms_deg', 'elevation_rms_deg', 'pointing_rms_deg')
    noise = values['single_sample_noise_deg']
    assert noise == pytest.approx(0.03, rel=0.1)
    assert read('pointing error, rms') == near(*rms)
    assert read('pointing error, largest') == near('cross_elevation_max_deg', 'elevation_max_deg', 'pointing_max_deg')
    assert read('pointing error by the encoders, rms') == near(*(f'encoder_{key}' for key in rms))
    assert read('pointing error by the encoders, largest')[1:2] == near('encoder_elevation_max_deg')
    assert values['encoder_cross_elevation_rms_deg'] == pytest.approx(
        math.degrees(math.hypot(TWIST, 0.0002 / math.sqrt(2.0)) * math.cos(0.8)), rel=0.05)
    assert 'those of the encoders:' not in page[0].text
    assert read("rms / receiver's single-sample noise") == near(*rms, scale=noise)
    assert read('noise reduction by the filter') == near(
        'noise_reduction_cross_elevation', 'noise_reduction_elevation', 'noise_reduction')
    assert read("receiver's single-sample noise") == near('single_sample_noise_deg')
    assert read('first lock') == near('lock_time_s') == [0.2]
    assert read('time in autotrack') == near('autotrack_time_s')
    assert read('loop rate achieved (time of the drive)') == pytest.approx([200.0])
    assert read('torque of motor 1, rms of the run') == [15.0, 13.0]
    assert read('load torque, rms of the run') == [100.0, 50.0]
    assert rows['lost steps (steps of the drive without a command)'] == ['0']
    assert rows['steps missing in the recording'] == ['0'] and rows['steps'] == [str(STEPS)]
    assert rows['recording'][0].startswith('complete')


def test_the_page_says_when_where_what_and_through_which_beam(page, texts_only, tmp_path):
    assert 'beamwidth' not in page[0].rows
    leo = page_of(REFERENCES / 'leo_pass', output=tmp_path / 'leo.html')
    assert leo.rows['target'] == ['satellite 25544, from its TLE']
    assert leo.rows['station'] == ['latitude 47.4, longitude 8.5 deg, height 500 m']
    assert leo.rows['beamwidth'] == ['1.003 deg']
    assert leo.rows['0 s is'][0].startswith('2019-12-09 16:4') and leo.rows['0 s is'][0].endswith(' UTC')
    assert re.fullmatch(r'\d\d\.\d deg at 2019-12-09 16:\d\d:\d\d UTC, [0-9.]+ s', leo.rows['highest'][0])
    flyby = page_of(REFERENCES / 'uav_flyby', output=tmp_path / 'uav.html')
    assert flyby.rows['target'][0].startswith('straight flight at 15 m/s') and 'station' not in flyby.rows
    for number in (7, 8, 9, 10, 11):
        text = f'(figure {number} of the paper)'
        assert text in flyby.text and text not in leo.text
    assert leo.rows['acu.tracker.lock_count'] == ['20', '100', '']
    assert 'acu.period' not in leo.rows
    assert leo.text.index('tracked 64.8 % of 4 s, first lock at 1.315 s') < leo.text.index('target')
    assert re.fullmatch(r'file of \d{4}-\d\d-\d\d .* UTC; a lockstep recording states no date',
                        leo.rows['date of the run'][0])


STORY = (*ASHORE, 'acu/command_result', 'adu/injected', 'acu/alarms')


@pytest.fixture(scope='module')
def story(tmp_path_factory):
    return make_bag(tmp_path_factory.mktemp('story') / 'story', STORY)


def test_the_events_are_a_table_with_senders_reasons_and_durations(story, texts_only, tmp_path):
    rows = page_of(story, output=tmp_path / 'story.html').rows
    found = [rows[str(number)] for number in range(1, 7)]
    assert found == [
        ['0.00', '0.25', 'mode', 'acu', 'program'],
        ['0.25', 'to the end', 'mode', 'acu', 'autotrack'],
        ['0.50', '', 'command', 'Ada', 'acu: track'],
        ['0.51', '', 'refused', 'scenario', 'acu: preset azimuth=9: refused: outside limits'],
        ['2.00', '1.50', 'injected fault', 'Ada', 'adu: motor_loss axis=azimuth duration=1.5'],
        ['2.05', '1.50', 'alarm', 'acu', 'motor_fault, high: a motor is off (azimuth motor 1)']]
    assert '7' not in rows


def test_the_events_are_marked_on_every_curve_over_time(story):
    recording = RecordedRun(bags.read(story))
    for spec in run_figures.FIGURES:
        with figures.matplotlib.rc_context(figures.MATPLOTLIB_STYLE):
            figure = spec.draw(recording)
            before = {axes: (axes.get_xlim(), len(axes.lines)) for axes in figure.axes}
            if spec.timed:
                figures.mark(figure, recording.events)
        for axes in figure.axes:
            (low, high), lines = before[axes]
            inside = [event for event in recording.events if low < event.t < high]
            assert len(axes.lines) - lines == (len(inside) if spec.timed else 0)
            assert axes.get_xlim() == (low, high)
    assert [text for text, _, _ in figures._labels(list(enumerate(recording.events, start=1)), 0.1)] == [
        '1', '2', '3-4', '5-6']


def test_a_fast_slew_is_no_chord_in_the_sky_plot():
    t = np.arange(0.0, 600.0, 0.005)
    azimuth = np.clip(2.0 * t, 0.0, 3.0) + 0.001 * t
    at = run_figures._along(np.column_stack((azimuth, np.full(t.size, 0.2))))
    assert at.size <= run_figures.SKY_POINTS and (at[0], at[-1]) == (0, t.size - 1)
    assert np.diff(azimuth[at]).max() < math.radians(1.0)
    assert np.diff(t[at]).max() < 1.0


def test_the_frame_is_that_of_the_tracking_and_not_of_the_slew(whole):
    recording = RecordedRun(bags.read(whole))
    recording.tracking.beam_earth[:40, 0] -= 2.0
    recording.raw_angles[:40, 0] -= 2.0
    with figures.matplotlib.rc_context(figures.MATPLOTLIB_STYLE):
        axes = run_figures.angle(recording).axes[0]
    low, high = axes.get_ylim()
    assert high - low < 40.0
    assert any('off scale outside the evaluated part' in text.get_text() for text in axes.texts)


def test_the_report_as_pdf_with_its_author(story, tmp_path, capsys):
    assert cli.main(['report', str(story), '--output', str(tmp_path / 'r.html'), '--author', 'A. <B>', '--pdf']) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / 'r.html'), str(tmp_path / 'r.pdf')]
    assert (tmp_path / 'r.pdf').read_bytes().startswith(b'%PDF')
    assert Page((tmp_path / 'r.html').read_text()).rows['author'] == ['A. <B>']


def test_the_filter_is_judged(page, whole):
    found = consistency.read(bags.read(whole), tracking.read(bags.read(whole)))
    for axis, i in (('azimuth', 0), ('elevation', 1)):
        judged = found.axes[i]
        assert f'{axis.capitalize()}: {judged.verdict}.' in page[0].text
        assert judged.nis == pytest.approx(1.0, rel=0.2)
        assert [float(page[0].rows['mean NIS'][i]), float(page[0].rows['mean NEES (angle and rate)'][i])] == \
            pytest.approx([judged.nis, judged.nees], rel=1e-3)
    # Angle and rate are made one tenth and one hundredth of the same noise; the filter states half of the latter.
    assert found.axes[1].nees == pytest.approx(1.0 + 0.25, rel=0.2)


def test_text_of_the_bag_is_escaped_and_repeats_are_one_row(page):
    assert page[0].rows['scenario'] == ['short <run>']
    assert page[0].rows['0.0 to 1.0'] == ['acu', 'WARN', 'waits for <lock> & more']


@pytest.mark.thorough
def test_same_bag_gives_same_bytes(page, whole, tmp_path):
    first = page[1]
    again = write_report(whole, tmp_path / 'b.html', tmp_path)
    assert again.read_bytes() == (first / 'sub' / 'r.html').read_bytes()
    for path in tmp_path.glob('*.png'):
        assert path.read_bytes() == (first / path.name).read_bytes()


def test_where_it_is_written(tmp_path):
    bag = make_bag(tmp_path / 'bag', ('clock',), steps=3)
    assert write_report(bag) == bag / 'report.html'
    bare = shutil.copy(bag / 'bag_0.mcap', tmp_path / 'bare.mcap')
    assert write_report(bare) == tmp_path / 'report.html'


@pytest.mark.thorough
@pytest.mark.parametrize('names, drawn, said', [
    (('clock', 'adu/motor_states'), ['torques'], 'no message of joint_states and target/truth'),
    (('joint_states', 'target/truth'), ['pointing', 'azimuth', 'sky'], 'no message of tracking_receiver/angle_error'),
    (('diagnostics', 'acu/mode'), ['timeline'], 'no message of adu/motor_states'),
])
def test_missing_topics(tmp_path, names, drawn, said):
    page = page_of(make_bag(tmp_path / 'part', names, steps=600), png_folder=tmp_path)
    assert page.drawn == drawn
    assert said in page.text
    assert sorted(path.stem for path in tmp_path.glob('*.png')) == sorted(drawn)


def test_a_recording_from_before_the_truth_says_that_its_errors_are_those_of_the_encoders(page, texts_only, tmp_path):
    old = page_of(make_bag(tmp_path / 'old', [name for name in ASHORE if name != 'adu/truth']))
    assert f'Pointing errors are those of the encoders: {tracking.ENCODER_BEAM_NOTE}.' in old.text
    assert 'pointing error by the encoders, rms' not in old.rows
    for name in ('rms', 'largest'):
        assert old.rows[f'pointing error, {name}'] == page[0].rows[f'pointing error by the encoders, {name}']


@pytest.mark.thorough
def test_never_locked(tmp_path):
    page = page_of(make_bag(tmp_path / 'dark', locked=False))
    assert 'Not drawn: the receiver never locked.' in page.text
    assert page.rows['pointing error, rms'] == ['not measured'] * 3
    assert page.rows['first lock'] == ['not measured']
    assert {'pointing', 'torques', 'carrier', 'timeline'} <= set(page.drawn)


@pytest.mark.thorough
@pytest.mark.parametrize('steps', [0, 1, 2])
def test_hardly_anything_recorded(tmp_path, steps):
    page = page_of(make_bag(tmp_path / 'short', steps=steps))
    assert len(page.ids) >= 2 + len(run_figures.FIGURES)
    if steps == 0:
        assert page.drawn == []
        assert 'no message of joint_states and target/truth' in page.text


def test_drive_that_gives_no_torque(tmp_path):
    page = page_of(make_bag(tmp_path / 'bare', ('joint_states', 'target/truth'), steps=20, effort=False))
    assert page.rows['load torque, rms of the run'] == ['not measured', 'not measured', '']


def test_lost_steps_are_shown(texts_only, tmp_path):
    page = page_of(make_bag(tmp_path / 'holes', steps=300, skip=(100, 101, 102)))
    assert page.rows['steps missing in the recording'] == ['3']
    assert 'gaps' in page.ids
    assert 'joint_states: missing 3 steps from 0.500000 to 0.510000 s' in page.text


def test_labels_in_the_page_are_those_drawn(whole):
    recording = RecordedRun(bags.read(whole))
    spec = run_figures.FIGURES[0]
    stream = io.StringIO()
    figures.render(spec, recording, stream)
    plain, inlined = (re.findall('<text[^>]*>([^<]*)</text>', text)
                      for text in (stream.getvalue(), figures.inline(stream.getvalue())))
    assert plain == inlined
    assert any(re.fullmatch(r'.?0\.\d{3,}', label) for label in plain)


def test_wall_jitter_of_realtime(texts_only, tmp_path):
    page = page_of(make_bag(tmp_path / 'wall', steps=301, pacing='realtime'))
    assert page.rows['loop rate achieved (wall time)'] == ['200.0\N{NO-BREAK SPACE}Hz']
    assert page.rows['jitter of the step, wall time'][0].startswith('1 ms rms')


def test_beamwidth_lines_only_when_known(whole, tmp_path):
    def dashed(path):
        recording = RecordedRun(bags.read(path))
        with figures.matplotlib.rc_context(figures.MATPLOTLIB_STYLE):
            panels = run_figures.pointing(recording).axes
        return [line.get_ydata()[0] for axes in panels for line in axes.lines if line.get_linestyle() == '--']
    assert dashed(whole) == []
    known = make_bag(tmp_path / 'known', steps=700, beamwidth=math.radians(1.0))
    assert dashed(known) == pytest.approx([-0.1, 0.1, -0.1, 0.1])


def test_broken_bags(tmp_path, whole):
    with pytest.raises(bags.BagError, match='No such file'):
        write_report(tmp_path / 'none.mcap')
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes((whole / 'whole_0.mcap').read_bytes()[:-500])
    with pytest.raises(bags.BagError, match='the file ends'):
        write_report(cut)
    assert not (tmp_path / 'report.html').exists()


def test_thin_keeps_extremes_and_gaps():
    t = np.arange(24001) * 0.005
    y = np.random.default_rng(2).standard_normal(t.size)
    y[12000] = 50.0
    y[7] = -50.0
    y[20000:20003] = math.nan
    y[:5] = math.nan
    seen_t, seen = figures.thin(t, y, bins=100)
    assert seen.size < 500
    assert np.nanmax(seen) == 50.0 and np.nanmin(seen) == -50.0
    assert (np.diff(seen_t) > 0.0).all()
    assert np.isnan(seen[np.searchsorted(seen_t, 100.0)]) and np.isnan(seen[0])
    assert seen_t[-1] == t[-1]


def test_azimuth_is_unwrapped():
    angle = np.radians(np.linspace(170.0, 190.0, 50))
    wrapped = (angle + np.pi) % (2.0 * np.pi) - np.pi
    wrapped[20] = math.nan
    out = run_figures._continuous(wrapped)
    assert np.isnan(out[20]) and np.nanmax(np.abs(out - np.degrees(angle))) < 1e-9


def test_an_aborted_run_and_lost_steps_stand_on_the_first_page(texts_only, tmp_path):
    path = make_bag(tmp_path / 'aborted', planned_end_ns=10_000_000_000)
    page = page_of(path)
    first = page.text[:page.text.index('Results')]
    assert f'Aborted: ends at {(STEPS - 1) * T / 1e9:.6f} s, planned end 10.000000 s.' in first
    assert 'Aborted' not in page_of(make_bag(tmp_path / 'whole', planned_end_ns=(STEPS - 1) * T)).text
