"""Specifications: what is read, and what is refused before anything moves."""
import dataclasses
import math

import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_workbench.acceptance import in_loop, specification
from pedestal_workbench.acceptance.methods import METHODS

ENTRY = """
  - name: settling
    method: step_settling
    arguments: {axis: elevation, size: 2}
    limit: '<= 1.5'
    unit: s
"""
WHOLE = f"""
title: Acceptance
customer: Zürich & Söhne
antenna: no. 7
tester: A. Smith
calibration: of 2026-11-20
requirements:{ENTRY}    repetitions: 3
    confidence: 0.9
  - {{name: slope, method: receiver_slope, limit: 1 +- 0.1, unit: '1'}}
"""


@pytest.fixture
def read(tmp_path):
    """read(text) -> the specification of a file with this text."""
    def call(text):
        path = tmp_path / 'spec.yaml'
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return specification.read(path)
    return call


def test_every_key_is_read(read):
    found = read(WHOLE)
    head = 'Acceptance', 'Zürich & Söhne', 'no. 7', 'A. Smith', 'of 2026-11-20'
    assert dataclasses.astuple(found.head) == head and found.text == WHOLE
    first, second = found.requirements
    assert (first.name, first.method.name, first.limit.text, first.repetitions, first.confidence) == (
        'settling', 'step_settling', '<= 1.5', 3, 0.9)
    assert first.arguments == {'axis': 'elevation', 'size': 2.0, 'band': 0.01}
    assert (second.repetitions, second.confidence) == (1, 0.95)
    assert second.limit.meets(1.09) and not second.limit.meets(1.11)


@pytest.mark.parametrize('old, new, words', [
    ('method: step_settling', 'method: step_setling', ('step_setling', "did you mean 'step_settling'?")),
    ('method: step_settling', 'method: [1]', ('method = [1]', 'must be text')),
    ('axis: elevation', 'axis: azimut', ('axis = azimut', 'must be one of azimuth, elevation')),
    ('size: 2', 'sise: 2', ("unknown argument 'sise'", 'size')),
    ('size: 2', 'size: 999', ('size = 999', '0.001 to 180')),
    ('size: 2', 'size: .nan', ('size = nan', '0.001 to 180')),
    ('size: 2', 'size: true', ('arguments', 'must be')),
    ('{axis: elevation, size: 2}', '7', ('arguments = 7', 'must be a section')),
    ('unit: s', 'unit: ms', ("unit = 'ms'", "must be 's'")),
    ('unit: s', 'units: s', ("unknown parameter 'units'", "did you mean 'unit'?")),
    ('    unit: s\n', '', ('unit: must be given',)),
    ("'<= 1.5'", "'>= 1.5'", ("'>= 1.5'", 'must have one of the words <=')),
    ("'<= 1.5'", "'<= nan'", ("'<= nan'", 'must be a text as')),
    ("'<= 1.5'", "'<= 1e999'", ("'<= 1e999'", 'finite numbers')),
    ("'<= 1.5'", "'<= 1 2'", ("'<= 1 2'", 'must be a text as')),
    ("'<= 1.5'", "'= 1'", ("'= 1'", 'must be a text as')),
    ("'<= 1.5'", '1.5', ('limit = 1.5', 'must be text')),
    ("'<= 1.5'", "'2 to 1'", ("'2 to 1'", 'no value is inside')),
    ("'<= 1.5'", "'1 to 1'", ("'1 to 1'", 'no value is inside')),
    ("'<= 1.5'", "'1 +- 0'", ("'1 +- 0'", 'no value is inside')),
    ("'<= 1.5'", "'1 +- -1'", ("'1 +- -1'", 'no value is inside')),
    ("'<= 1.5'", '>= 1.5', ('stands in quotes',)),
    ('1 +- 0.1', '<= 1', ("'<= 1'", 'must have one of the words +-, to')),
    ('repetitions: 3', 'repetitions: 0', ('repetitions = 0', 'must be 1 to 100')),
    ('repetitions: 3', 'repetitions: 101', ('repetitions = 101', '1 to 100')),
    ('repetitions: 3', 'repetitions: 2.5', ('repetitions = 2.5', 'whole number')),
    ('repetitions: 3', 'repetitions: true', ('repetitions = True', 'must be a number')),
    ('confidence: 0.9', 'confidence: 95', ('confidence = 95', '0.5 to 0.999')),
    ('confidence: 0.9', 'confidence: .nan', ('confidence = nan', '0.5 to 0.999')),
    ('name: settling', 'name: [a]', ("name = ['a']", 'must be text')),
    ('name: settling', 'name: ""', ('name: must be given',)),
    ('name: settling', 'name: "a\\0b"', ('name = ', 'must be a text')),
    ('name: settling', f'name: {"a" * 61}', ('name = ', '1 to 60 characters')),
    ('name: slope', 'name: Settling', ("'Settling'", 'given twice')),
    ('name: slope', 'name: SETTLING', ("'SETTLING'", 'given twice')),
    ('title: Acceptance', 'titel: Acceptance', ("unknown parameter 'titel'", "did you mean 'title'?")),
    ('title: Acceptance\n', '', ('title: must be given',)),
    ('title: Acceptance', 'title: "a\\nb"', ('title', 'one line')),
    ('customer: Zürich & Söhne', 'customer: 7', ('customer = 7', 'must be text')),
    ('  - name: settling', '  - 7\n  - name: settling', ('requirement 1: 7', 'must hold the keys')),
])
def test_a_bad_entry_is_refused_with_its_file_entry_field_and_range(read, old, new, words):
    assert old in WHOLE
    with pytest.raises(ValueError) as error:
        read(WHOLE.replace(old, new, 1))
    assert 'spec.yaml' in str(error.value) and len(str(error.value).splitlines()) == 1
    for word in words:
        assert word in str(error.value)


def test_all_problems_of_a_file_are_stated_together(read):
    with pytest.raises(ValueError) as error:
        read(WHOLE.replace("'<= 1.5'", "'2 to 1'").replace('0.1', 'nan').replace('title', 'titel'))
    lines = str(error.value).splitlines()
    assert len(lines) == 3 and all('spec.yaml: ' in line for line in lines)
    assert "requirement 1 'settling'" in lines[1] and "requirement 2 'slope'" in lines[2]


@pytest.mark.parametrize('text', [
    '', '7', '[]', '{}', 'requirements: []', 'title: a\nrequirements: 7', 'title: a\nrequirements:', b'\xff\xfe\x00',
    'title: a\nrequirements: [*a]', 'a: &a [x]\nb: [*a, *a]', '!!python/object/apply:os.system [ls]', '{' * 100,
    'title: a\nrequirements: [' + '{},' * 300 + ']', 'title: a\ntitle: b', '\t- a',
    'requirements: ' + '[' * 30 + ']' * 30])
def test_an_empty_or_hostile_file_is_refused(read, text):
    with pytest.raises(ValueError, match=r'spec\.yaml: .+'):
        read(text)


def test_a_file_that_is_none_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / 'missing', '/dev/zero'):
        with pytest.raises(ValueError, match=str(path)):
            specification.read(path)
    huge = tmp_path / 'huge.yaml'
    huge.write_text('#' * 3_000_000)
    with pytest.raises(ValueError, match='must be at most'):
        specification.read(huge)


@pytest.mark.parametrize('scenario', ['station_real', 'uav_tracker_3m'])
def test_what_an_antenna_cannot_do_is_refused_with_the_name_of_its_requirement(read, scenario):
    performer = in_loop.InLoop(Variant(scenario))
    good, bad = ENTRY.replace('size: 2', 'size: 0.5'), ENTRY.replace('size: 2', 'size: 180').replace(
        'settling\n', 'too far\n', 1)
    assert len(read(f'title: a\nrequirements:{good}').exercises(performer)) == 1
    with pytest.raises(ValueError) as error:
        read(f'title: a\nrequirements:{good}{bad}{bad.replace("too far", "too far again")}').exercises(performer)
    lines = str(error.value).splitlines()
    assert len(lines) == 2 and "requirement 'too far': size = 180" in lines[0] and 'too far again' in lines[1]


@pytest.mark.parametrize(('name', 'unit', 'said'), [
    ('gust_error', 'deg', 'gust of adu: must be of a simulated node'),
    ('fault_report', 's', 'drop of adu: must be of a simulated node'),
    ('fade_recovery', 's', 'fade of tracking_receiver: must be of a simulated node'),
    ('program_rms', 'deg', 'must have a simulated receiver')])
def test_a_fault_is_refused_without_a_simulated_node(read, name, unit, said):
    performer = in_loop.InLoop(Variant('station_real'))
    target = 'arguments: {target: own}, ' if name in ('fade_recovery', 'program_rms') else ''
    spec = read(f"title: a\nrequirements:\n- {{name: x, method: {name}, {target}limit: '<= 1', unit: {unit}}}")
    assert len(spec.exercises(performer)) == 1
    performer.antenna = performer.antenna._replace(simulated=())
    with pytest.raises(ValueError, match=f"requirement 'x'.*{said}"):
        spec.exercises(performer)


def test_an_exercise_stays_within_the_travel_of_its_antenna():
    """Of every method with its defaults, on two antennas."""
    for scenario in ('station_real', 'uav_tracker_3m'):
        antenna = in_loop.antenna(Variant(scenario).load())
        for method in METHODS:
            arguments = {one.name: 'simulated' if one.name == 'pins' else one.default for one in method.arguments}
            for span, axis in zip(method.exercise(antenna, arguments).envelope,
                                  (antenna.acu.azimuth.limits, antenna.acu.elevation.limits)):
                low, high = (math.degrees(end) for end in (axis.low, axis.high))
                assert low - 5.0 <= span.low < span.high <= high + 5.0, method.name
                assert 0.0 < span.rate <= 1.5 * math.degrees(axis.rate), method.name


@pytest.mark.parametrize('name, file_name', [
    ('ramp, 0.1 deg/s', 'ramp,_0.1_deg_s'), ('../../etc/passwd', '__.._etc_passwd'), ('-rf *', '_rf_'),
    ('Überschwingen', 'Überschwingen')])
def test_files_have_names_without_harm(read, name, file_name):
    found = read(WHOLE.replace('name: settling', f"name: '{name}'")).requirements[0]
    assert (found.name, found.file_name) == (name, file_name)
