// Alarms and events. All texts are inserted as text, never as HTML.
import {onDraw, request} from './link.js';
import {press} from './refusals.js';
import {find, make, setText, time} from './text.js';

const SHELVE_DURATIONS_S = [600, 3600, 28800];
const URGENT_PRIORITIES = ['critical', 'high'];
const UNACKNOWLEDGED_STATES = ['unacknowledged', 'returned unacknowledged', 'latched unacknowledged'];

function button(text, verb, alarm) {
  const made = make('button', '', text);
  made.setAttribute('aria-label', `${verb} ${alarm.name}`);
  press(made, verb, () => request(verb, {alarm: alarm.name}));
  return made;
}

function shelf(alarm) {
  const choice = make('select');
  choice.setAttribute('aria-label', `shelve ${alarm.name}`);
  choice.appendChild(make('option', '', 'shelve'));
  for (const seconds of SHELVE_DURATIONS_S) {
    const option = make('option', '', seconds < 3600 ? `${seconds / 60} min` : `${seconds / 3600} h`);
    option.value = seconds;
    choice.appendChild(option);
  }
  choice.onchange = () => request('shelve', {alarm: alarm.name, seconds: choice.value, reason: 'from the page'});
  choice.dataset.verb = 'shelve';
  return choice;
}

function alarmRow(alarm) {
  const waits = UNACKNOWLEDGED_STATES.includes(alarm.state);
  const shelved = alarm.state === 'shelved';
  const row = make('div', `alarm ${alarm.priority}${waits ? ' waits' : ''}${shelved ? ' shelved' : ''}`
                          + (alarm.cause ? ' under' : ''));
  row.dataset.alarm = alarm.name;
  row.dataset.state = alarm.state;
  row.appendChild(make('span', 'priority', shelved ? 'shelved' : alarm.priority));
  const name = make('span', 'name', `${waits ? '◆ ' : ''}${alarm.name}`);
  const notes = [time(alarm.raised), alarm.state];
  if (alarm.first_out === '1') notes.push('first');
  if (alarm.cause) notes.push(`because of ${alarm.cause}`);
  name.appendChild(make('small', '', notes.join(' · ')));
  row.appendChild(name);
  row.appendChild(make('span', 'text', [alarm.detail || alarm.meaning, `→ ${alarm.action}`].join('  ')));
  const hands = make('span', 'hands');
  if (waits) hands.appendChild(button('ack', 'acknowledge', alarm));
  hands.appendChild(shelved ? button('unshelve', 'unshelve', alarm) : shelf(alarm));
  row.appendChild(hands);
  return row;
}

let announced = [];  // unacknowledged alarms that were announced

// Announce the fresh alarms to screen readers: the grave ones at once, the others after the present speech.
function announce(waiting) {
  const fresh = waiting.filter((alarm) => !announced.includes(alarm.name));
  announced = waiting.map((alarm) => alarm.name);
  for (const [id, grave] of [['urgent', true], ['news', false]]) {
    const texts = fresh.filter((alarm) => URGENT_PRIORITIES.includes(alarm.priority) === grave)
        .map((alarm) => `${alarm.priority} alarm at ${time(alarm.raised)}: ${alarm.name}. ${alarm.detail || alarm.meaning}. ${alarm.action}.`);
    if (texts.length) setText(find(id), texts.join(' '), 'hidden');
  }
}

function showAlarms(alarms) {
  const waiting = alarms.filter((alarm) => UNACKNOWLEDGED_STATES.includes(alarm.state));
  const rest = alarms.filter((alarm) => !waiting.includes(alarm));
  announce(waiting);
  find('alarm-list').replaceChildren(...[...waiting, ...rest].map(alarmRow));
  if (!alarms.length) find('alarm-list').appendChild(make('div', 'none', 'none'));
  setText(find('alarm-count'), alarms.length ? `${waiting.length} of ${alarms.length} unacknowledged` : '',
      waiting.length ? 'warn' : '');
  find('acknowledge-all').hidden = !waiting.length;
}

function eventRow({t, who, text, bad}) {
  const row = make('div', 'event');
  row.appendChild(make('time', '', time(t)));
  const line = make('div', bad ? 'warn' : '');
  line.appendChild(make('em', '', `${who} `));
  line.appendChild(document.createTextNode(text));
  row.appendChild(line);
  return row;
}

export function begin() {
  press(find('acknowledge-all'), 'acknowledge', () => request('acknowledge'));
  onDraw((sections) => {
    if (sections.alarms) showAlarms(sections.alarms);
    if (sections.log) find('log-list').replaceChildren(...sections.log.slice().reverse().map(eventRow));
  });
}
