// Commands of the operator: modes, preset, jog, control. A grey button would be refused and shows the reason.
import {Jog} from './jog.js';
import {me, onState, request, state} from './link.js';
import {press, refusal, showMessage} from './refusals.js';
import {decimal, find, make, setText} from './text.js';

const REFRESH_PERIOD_MS = 500;
const FALLBACKS = ['coast', 'memory', 'program', 'search', 'preset', 'standby'];
const RADIANS_PER_DEGREE = Math.PI / 180;
const MIN_COMMON_COUNT = 3;  // buttons that share a reason, which one line then shows for all of them

function setRefusal(button, reason, text = '') {
  if (button.tagName === 'SELECT') button.disabled = Boolean(reason);
  else button.setAttribute('aria-disabled', String(Boolean(reason)));
  if (button.title !== reason) button.title = reason;
  const small = button.querySelector('small');
  if (small) setText(small, text);
}

function showModes(names) {
  find('modes').replaceChildren(...names.filter((name) => name !== 'preset').map((name) => {
    const button = make('button', '', name);
    button.appendChild(make('small'));
    press(button, name, () => request(name));
    return button;
  }));
}

function showDrive(rows) {
  find('drive-requests').replaceChildren(make('span', 'label', 'drive'), ...rows.map(({name, verb, doc}) => {
    const button = make('button', '', name);
    button.setAttribute('aria-label', `drive: ${doc}`);
    press(button, verb, () => request(verb));
    return button;
  }));
}

// Return the reason that at least MIN_COMMON_COUNT of the buttons share, '' without one.
function commonReason(reasons) {
  const counts = new Map();
  for (const reason of reasons.filter(Boolean)) counts.set(reason, (counts.get(reason) || 0) + 1);
  const [reason, count] = [...counts].sort((a, b) => b[1] - a[1])[0] || ['', 0];
  return count >= MIN_COMMON_COUNT ? reason : '';
}

// Show a reason that most buttons share once for all of them; each other reason stands in its button.
function showRefusals(jog) {
  const buttons = [...document.querySelectorAll('#controls [data-verb]')];
  const reasons = buttons.map((button) => refusal(button.dataset.verb));
  const jogReason = refusal('rate');
  const common = commonReason([...reasons, jogReason]);
  buttons.forEach((button, i) => setRefusal(button, reasons[i], reasons[i] === common ? '' : reasons[i]));
  for (const button of jog.buttons) setRefusal(button, jogReason);
  if (jogReason) jog.release();
  const line = [common && `grey: ${common}`, jogReason !== common && jogReason && `jog: ${jogReason}`];
  setText(find('common-refusal'), line.filter(Boolean).join('; '));
  find('common-refusal').title = find('common-refusal').textContent;
  for (const button of document.querySelectorAll('#authority button, #alarms [data-verb]')) {
    const reason = refusal(button.dataset.verb);
    setRefusal(button, reason, reason);
  }
}

function requestPreset() {
  const {azimuth, elevation} = find('preset').elements;
  const angles = [azimuth, elevation].map((input) => decimal(input.value));
  if (angles.includes(null)) {
    showMessage('preset: azimuth and elevation must be decimal numbers [deg], such as 12.5', true);
    return;
  }
  request('preset', {azimuth: angles[0] * RADIANS_PER_DEGREE, elevation: angles[1] * RADIANS_PER_DEGREE});
}

export function begin() {
  const jog = new Jog((reason) => showMessage(`jog: ${reason}`, true));
  press(find('preset').querySelector('button'), 'preset', requestPreset);
  press(find('take'), 'take', () => request('take', me.role === 'supervisor' ? {role: 'supervisor'} : {}));
  press(find('release'), 'release', () => request('release'));
  press(find('allow'), 'allow', () => request('allow', {client: state.status.requester}));
  press(find('reset'), 'reset', () => request('reset'));
  for (const name of FALLBACKS) find('choose-fallback').appendChild(make('option', '', name));
  find('choose-fallback').onchange = (event) => request('fallback', {mode: event.target.value});
  let known = '';
  onState((sections) => {
    if (sections.fixed && known !== sections.fixed.modes.join()) {
      known = sections.fixed.modes.join();
      showModes(sections.fixed.modes);
      showDrive(sections.fixed.drive);
    }
    if (sections.status) {
      const {fallback, mode, requester} = sections.status;
      find('allow').hidden = !requester;
      find('allow').firstChild.data = `allow ${requester} to take control`;
      for (const button of find('modes').children) button.classList.toggle('on', button.dataset.verb === mode);
      if (document.activeElement !== find('choose-fallback')) find('choose-fallback').value = fallback;
    }
    for (const reply of sections.replies || []) {
      if (reply.error) showMessage(reply.error, true);
      if (reply.verb) showMessage(`${reply.verb}: ${reply.reply}`, !reply.granted);
    }
    if (sections.status || sections.replies || !me.open) showRefusals(jog);
  });
  setInterval(() => showRefusals(jog), REFRESH_PERIOD_MS);
}
