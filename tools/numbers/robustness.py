"""Tables of the studies consistency, wrong-slope and structure: how sure the target filter is, and what filter and
alarm do with a bad receiver or antenna."""
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Row
from pedestal_results.intervals import missed
from pedestal_studies.system import consistency, structure, wrong_slope

Rows: TypeAlias = Mapping[tuple[str, str, str], Row]
Content: TypeAlias = tuple[Sequence[str], Sequence[Sequence[str]]]  # of a table: heads of the columns, lines of cells


def _interval(rows: Rows, study: str, case: str, metric: str, form: str) -> str:
    """Return 'mean (low to high)' of a row; '-' without a row, or for an end that the runs do not reach."""
    key = study, case, metric
    if key not in rows:
        return '-'
    value, low, high = ('-' if rows[key][part] is None else f'{rows[key][part]:{form}}'
                        for part in ('value', 'ci_low', 'ci_high'))
    return f'{value} ({low} to {high})' + ' MISSED' * missed(rows[key])


def _cell(rows: Rows, case: str, metric: str, form: str = '.1f') -> str:
    """Return the interval of a row of wrong-slope."""
    return _interval(rows, 'wrong-slope', case, metric, form)


def consistency_table(rows: Rows) -> Content:
    """Return the table of the NEES, over the time after the first estimate."""
    return ('case', 'axis', *(f'{time:g} s' for time in consistency.TIMES_S)), [
        (f'`{case}`', axis, *(_interval(rows, 'consistency', case, f'nees_{axis}_{time:g}_s', '.2f')
                              for time in consistency.TIMES_S)) for case in consistency.CASES for axis in AXES]


def slope_table(rows: Rows) -> Content:
    """Return the table of the wrong slopes, over all targets."""
    return ('slope', 'alarm within 200 steps, %', 'possible with a known target, %', 'median, steps',
            'alarm within 2 s, %', 'lost without alarm, %', 'largest error, beamwidths'), [
        (f'`{name}`', *(_cell(rows, f'all/{name}', metric) for metric in ('in_time_percent', 'known_in_time_percent')),
         _cell(rows, f'all/{name}', 'alarm_steps_median', '.0f'),
         *(_cell(rows, f'all/{name}', metric) for metric in ('alarm_percent', 'lost_percent')),
         _cell(rows, f'all/{name}', 'largest_error_beamwidths', '.2f')) for name in wrong_slope.SLOPES]


def reversal_table(rows: Rows) -> Content:
    """Return the table of the errors with the wrong sign, and of the false alarms, for each target."""
    return ('target', 'alarm within 200 steps, %', 'possible with a known target, %', 'median, steps',
            'runs', 'hours of right slope', 'false alarms in 10 h'), [
        (f'`{target}`', _cell(rows, f'{target}/turn-180', 'in_time_percent', '.0f'),
         _cell(rows, f'{target}/turn-180', 'known_in_time_percent', '.0f'),
         _cell(rows, f'{target}/turn-180', 'alarm_steps_median', '.0f'),
         str(rows['wrong-slope', f'{target}/turn-180', 'in_time_percent']['runs']),
         f'{rows["wrong-slope", f"{target}/right", "hours"]["value"]:.2f}',
         _cell(rows, f'{target}/right', 'false_alarms_per_10_h')) for target in ('all', *wrong_slope.TARGETS)]


def limit_table(rows: Rows) -> Content:
    """Return the table of the limits of the alarm: alarms in time against false alarms."""
    return ('both limits times', 'alarm within 200 steps, %', 'false alarms in 10 h'), [
        (f'{factor:g}', _cell(rows, f'limits/{factor:g}', 'in_time_percent'),
         _cell(rows, f'limits/{factor:g}', 'false_alarms_per_10_h')) for factor in wrong_slope.LIMIT_FACTORS]


def structure_table(rows: Rows) -> Content:
    """Return the table of the ratios of the study structure, and of the lost runs."""
    def cell(case: str) -> str:
        held, lost = (round(rows['structure', case, metric]['value']) for metric in ('held_runs', 'lost_runs'))
        if ('structure', case, structure.RATIO) in rows:
            return _interval(rows, 'structure', case, structure.RATIO, '.3f')
        return f'{lost} of {held} lost' + ' MISSED' * (lost > 0) if held else ''
    return ('share', 'air', *(f'{frequency:g} Hz' for frequency in structure.FREQUENCIES_HZ)), [
        (f'{share:g}', air, *(cell(f'{frequency:g}Hz-{share:g}-{air}') for frequency in structure.FREQUENCIES_HZ))
        for share in structure.SHARES for air in structure.AIR_PARAMETERS]


TABLES = {'consistency': consistency_table, 'wrong slopes': slope_table, 'reversed slopes': reversal_table,
          'limits of the alarm': limit_table, 'filter on a structure': structure_table}
