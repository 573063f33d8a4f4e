// Commands of the operator: modes, preset, jog, control, STOP. A button shows the reason of a refusal.
import {isStale, jog, me, onState, rename, request, state} from './link.js';
import {find, make, setText} from './text.js';

const JOG_PERIOD_MS = 200;
const STOP_REPLY_TIMEOUT_MS = 1500;
const JOG_RATES_DEG_S = [0.1, 0.2, 0.5, 1, 2, 5];
const FALLBACKS = ['coast', 'memory', 'program', 'search', 'preset', 'standby'];
const RADIANS_PER_DEGREE = Math.PI / 180;
const FREE_COMMANDS = ['standby'];  // allowed without control

const hasControl = (status) => status.control === '' || status.control.startsWith(`${me.name}@page `);

// Return the reason of a present refusal of a command, '' without a known reason.
export function refusal(verb) {
  if (state.replay) return 'recording';
  if (!me.open || isStale()) return 'no link';
  if (me.role === 'monitor') return 'role monitor';
  if (!state.status) return 'no state received';
  if (!FREE_COMMANDS.includes(verb) && verb !== 'take' && !hasControl(state.status)) {
    return `held by ${state.status.control}`;
  }
  return state.status.refused[verb === 'jog' ? 'rate' : verb] || '';
}

function setRefusal(button, reason) {
  if (button.title === reason && button.hasAttribute('aria-disabled')) return;
  button.setAttribute('aria-disabled', String(Boolean(reason)));
  button.title = reason;
  const small = button.querySelector('small');
  if (small) setText(small, state.replay ? '' : reason);
}

function press(button, verb, act) {
  button.onclick = (event) => {
    event.preventDefault();
    const reason = refusal(verb);
    if (reason) showMessage(`${verb}: ${reason}`, true); else act();
  };
}

function showMessage(text, bad = false) { setText(find('message'), text, bad ? 'warn' : ''); }

function warn(text) {
  find('banner').hidden = false;
  setText(find('banner'), text);
}

function showModes(names) {
  find('modes').replaceChildren(...names.filter((name) => name !== 'preset').map((name) => {
    const button = make('button', '', name);
    button.dataset.verb = name;
    button.appendChild(make('small'));
    press(button, name, () => request(name));
    return button;
  }));
}

// The page repeats the rates while a button is held. When the button is released, or the page is hidden, loses focus
// or closes, the repetition ends and the axes stop.
class Jog {
  constructor() {
    for (const rate of JOG_RATES_DEG_S) {
      const option = make('option', '', `${rate}`);
      option.value = rate;
      find('jog-rate').appendChild(option);
    }
    find('jog-rate').value = 0.5;
    this.timer = null;
    this.buttons = document.querySelectorAll('[data-jog]');
    for (const button of this.buttons) {
      button.onpointerdown = (event) => {
        button.setPointerCapture(event.pointerId);
        this.hold(button);
      };
      button.onpointerup = button.onpointercancel = button.onlostpointercapture = () => this.release();
      button.oncontextmenu = (event) => event.preventDefault();
    }
    window.addEventListener('blur', () => this.release());
    document.addEventListener('visibilitychange', () => this.release());
  }

  hold(button) {
    this.release();
    const reason = refusal('jog');
    if (reason) { showMessage(`jog: ${reason}`, true); return; }
    const directions = button.dataset.jog.split(' ').map(Number);
    const sendJog = () => jog(directions.map((direction) => direction * Number(find('jog-rate').value)));
    button.classList.add('held');
    sendJog();
    this.timer = setInterval(sendJog, JOG_PERIOD_MS);
  }

  release() {
    if (this.timer === null) return;
    clearInterval(this.timer);
    this.timer = null;
    for (const button of this.buttons) button.classList.remove('held');
    jog([0, 0]);
  }

  update() {
    const reason = refusal('jog');
    setText(find('jog-refusal'), state.replay ? '' : reason);
    for (const button of this.buttons) setRefusal(button, reason);
    if (reason) this.release();
  }
}

class Stop {
  constructor() {
    this.requestTime = null;
    find('stop').onclick = () => {
      this.requestTime = performance.now();
      if (!request('stop')) this.fail('STOP was not sent: no link');
    };
    setInterval(() => {
      if (this.requestTime !== null && performance.now() - this.requestTime > STOP_REPLY_TIMEOUT_MS) {
        this.fail('STOP has no reply');
      }
    }, 200);
  }

  fail(problem) {
    this.requestTime = null;
    warn(`${problem}. Use the emergency stop of the antenna.`);
  }

  take(reply) {
    if (['stop', 'standby'].includes(reply.verb) && reply.granted) {
      this.requestTime = null;
      find('banner').hidden = true;
    }
  }
}

function showHeader({status}) {
  setText(find('mode'), status.mode || '-');
  setText(find('reason'), status.reason ? `${status.reason}${status.coasting === '1' ? ', coasting' : ''}` : '');
  const ready = status.drive.startsWith('enabled');
  setText(find('drive'), status.drive || '-', ready && status.drive === 'enabled' ? '' : ready ? 'warn' : 'bad');
  setText(find('control'), status.control || 'none', status.control && !hasControl(status) ? 'warn' : '');
  setText(find('fallback'), status.fallback || '-');
  for (const button of find('modes').children) button.classList.toggle('on', button.dataset.verb === status.mode);
}

function showLink() {
  const {status} = state;
  const silent = status ? Object.keys(status.nodes).find((name) => status.nodes[name] === 'silent') : '';
  const condition = !me.open ? 'lost' : isStale() ? 'stale' : !status || !status.present ? 'no ACU'
    : silent ? `no ${silent}` : 'live';
  const stepped = status && status.steps > 0;
  setText(find('time-label'), `${state.now && state.now.t < 1e8 ? 'time' : 'UTC'}${stepped ? ', clock stepped' : ''}`,
      stepped ? 'label warn' : 'label');
  setText(find('link'), state.replay ? 'recording' : condition, condition === 'live' || state.replay ? '' : 'bad');
  setText(find('role'), `${me.role || 'page'}, user name`, 'label');
  if (document.activeElement !== find('name')) find('name').value = me.name;
}

export function begin() {
  const jogButtons = new Jog();
  const stop = new Stop();
  const preset = find('preset').elements;
  press(find('preset').querySelector('button'), 'preset', () => {
    const angles = ['azimuth', 'elevation'].map((axis) => Number(preset[axis].value.replace(',', '.')));
    const empty = ['azimuth', 'elevation'].some((axis) => preset[axis].value.trim() === '');
    if (empty || !angles.every(Number.isFinite)) {
      showMessage('preset: azimuth and elevation must be numbers [deg]', true);
      return;
    }
    request('preset', {azimuth: angles[0] * RADIANS_PER_DEGREE, elevation: angles[1] * RADIANS_PER_DEGREE});
  });
  press(find('take'), 'take', () => request('take', me.role === 'supervisor' ? {role: 'supervisor'} : {}));
  press(find('release'), 'release', () => request('release'));
  press(find('reset'), 'reset', () => request('reset'));
  for (const name of FALLBACKS) find('choose-fallback').appendChild(make('option', '', name));
  find('choose-fallback').onchange = (event) => request('fallback', {mode: event.target.value});
  find('name').onchange = (event) => rename(event.target.value);
  let known = '';
  const refresh = () => {
    showLink();
    for (const button of document.querySelectorAll('[data-verb]')) setRefusal(button, refusal(button.dataset.verb));
    const {status} = state;
    const taken = status && !hasControl(status) && me.role !== 'supervisor' ? `held by ${status.control}` : '';
    const held = status && status.control && hasControl(status) ? 'you are in control' : '';
    setRefusal(find('take'), refusal('take') || taken || held);
    setRefusal(find('release'), refusal('release') || (status && status.control === '' ? 'control is free' : ''));
    setRefusal(find('reset'), refusal('reset'));
    jogButtons.update();
    find('stop').disabled = Boolean(state.replay);
    find('choose-fallback').disabled = Boolean(refusal('fallback'));
  };
  onState((sections) => {
    if (sections.fixed && known !== sections.fixed.modes.join()) {
      known = sections.fixed.modes.join();
      showModes(sections.fixed.modes);
    }
    if (sections.status) {
      showHeader(sections);
      if (document.activeElement !== find('choose-fallback')) find('choose-fallback').value = sections.status.fallback;
    }
    for (const reply of sections.replies || []) {
      stop.take(reply);
      if (reply.error) showMessage(reply.error, true);
      if (reply.verb) showMessage(`${reply.verb}: ${reply.reply}`, !reply.granted);
    }
    if (sections.status || sections.replies || !me.open) refresh();
  });
  setInterval(() => {
    refresh();
    if (me.unauthorized) warn('The server was restarted: open the address that it printed.');
  }, 500);
}
