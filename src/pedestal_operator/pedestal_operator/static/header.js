// The header: mode and reason, drive, control, link, time, and the first alarm.
import {condition, me, onState, rename, state} from './link.js';
import {mayCommand} from './refusals.js';
import {find, setText, time} from './text.js';

const CELLS = ['mode', 'reason', 'drive', 'control', 'fallback'];

function showHeader(status) {
  for (const name of CELLS) {
    const {text, level} = status.header[name];
    const held = name === 'control' && !mayCommand(status) ? 'warn' : '';
    setText(find(name), text || (name === 'reason' ? '' : '-'), level || held);
    find(name).title = text;
  }
}

function showFirstAlarm({first_alarm: alarm}, count) {
  const place = find('first-alarm');
  const [name, text] = place.children;
  place.className = alarm ? alarm.priority : '';
  setText(name, alarm ? `${alarm.priority} alarm: ${alarm.name}${count > 1 ? ` (1 of ${count})` : ''}` : 'no alarms');
  setText(text, alarm ? `→ ${alarm.action}` : '');
  place.title = alarm ? alarm.detail || alarm.meaning : '';
}

function showLink() {
  const {now, replay, status} = state;
  const present = condition();
  const link = replay && present === 'live' ? {text: 'recording', level: ''} : present !== 'live' ? {text: present, level: 'bad'}
    : status ? status.header.link : {text: 'no state', level: 'bad'};
  setText(find('link'), link.text, link.level);
  const stepped = status && status.steps > 0;
  setText(find('time-label'), `${now && now.t < 1e8 ? 'time' : 'UTC'}${stepped ? ', clock stepped' : ''}`,
      stepped ? 'label warn' : 'label');
  if (now) setText(find('time'), time(now.t));
  setText(find('role'), `you: ${me.role || '-'}`, 'label');
  if (document.activeElement !== find('name')) find('name').value = me.name;
}

export function begin() {
  find('name').onchange = (event) => rename(event.target.value);
  onState((sections) => {
    if (sections.status) showHeader(sections.status);
    if (state.status && (sections.status || sections.alarms)) showFirstAlarm(state.status, state.alarms.length);
    showLink();
  });
  setInterval(showLink, 500);
}
