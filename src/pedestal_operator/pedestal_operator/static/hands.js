// What the operator does: modes, preset, jog, control, STOP. A button that would be refused says why.
import {ask, jog, late, me, onState, rename, state} from './link.js';
import {find, make, say} from './text.js';

const REPEAT = 200;  // ms between two messages of a jog that is held
const UNCONFIRMED = 1500;  // ms after STOP without a reply
const RATES = [0.1, 0.2, 0.5, 1, 2, 5];
const FALLBACKS = ['coast', 'memory', 'program', 'search', 'preset', 'standby'];
const RADIANS = Math.PI / 180;
const FREE = ['standby'];  // what the holder of control cannot keep from others

const holds = (told) => told.control === '' || told.control.startsWith(`${me.name}@page `);

// Why a verb would be refused now; '' where nothing is known against it.
export function refusal(verb) {
  if (state.replay) return 'a recording';
  if (!me.open || late()) return 'no link';
  if (me.role === 'monitor') return 'only looks';
  if (!state.told) return 'no state yet';
  if (!FREE.includes(verb) && verb !== 'take' && !holds(state.told)) return `held by ${state.told.control}`;
  return state.told.refused[verb === 'jog' ? 'rate' : verb] || '';
}

function offer(button, why) {
  if (button.title === why && button.hasAttribute('aria-disabled')) return;
  button.setAttribute('aria-disabled', String(Boolean(why)));
  button.title = why;
  const small = button.querySelector('small');
  if (small) say(small, state.replay ? '' : why);
}

function press(button, verb, act) {
  button.onclick = (event) => {
    event.preventDefault();
    const why = refusal(verb);
    if (why) saying(`${verb}: ${why}`, true); else act();
  };
}

function saying(text, bad = false) { say(find('said'), text, bad ? 'warn' : ''); }

function warn(text) {
  find('banner').hidden = false;
  say(find('banner'), text);
}

function modes(names) {
  find('modes').replaceChildren(...names.filter((name) => name !== 'preset').map((name) => {
    const button = make('button', '', name);
    button.dataset.verb = name;
    button.appendChild(make('small'));
    press(button, name, () => ask(name));
    return button;
  }));
}

// Held: the rates are sent again and again. Let go, hidden, out of focus, gone: they are not, and the axes stand.
class Jog {
  constructor() {
    for (const rate of RATES) {
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
    const why = refusal('jog');
    if (why) { saying(`jog: ${why}`, true); return; }
    const ways = button.dataset.jog.split(' ').map(Number);
    const tell = () => jog(ways.map((way) => way * Number(find('jog-rate').value)));
    button.classList.add('held');
    tell();
    this.timer = setInterval(tell, REPEAT);
  }

  release() {
    if (this.timer === null) return;
    clearInterval(this.timer);
    this.timer = null;
    for (const button of this.buttons) button.classList.remove('held');
    jog([0, 0]);
  }

  offer() {
    const why = refusal('jog');
    say(find('jog-why'), state.replay ? '' : why);
    for (const button of this.buttons) offer(button, why);
    if (why) this.release();
  }
}

class Stop {
  constructor() {
    this.asked = null;
    find('stop').onclick = () => {
      this.asked = performance.now();
      if (!ask('stop')) this.fail('STOP was not sent: no link');
    };
    setInterval(() => {
      if (this.asked !== null && performance.now() - this.asked > UNCONFIRMED) this.fail('STOP is not confirmed');
    }, 200);
  }

  fail(what) {
    this.asked = null;
    warn(`${what}. Use the emergency stop of the antenna.`);
  }

  heard(reply) {
    if (['stop', 'standby'].includes(reply.verb) && reply.granted) {
      this.asked = null;
      find('banner').hidden = true;
    }
  }
}

function head({told}) {
  say(find('mode'), told.mode || '-');
  say(find('reason'), told.reason ? `${told.reason}${told.coasting === '1' ? ', coasting' : ''}` : '');
  const ready = told.drive.startsWith('enabled');
  say(find('drive'), told.drive || '-', ready && told.drive === 'enabled' ? '' : ready ? 'warn' : 'bad');
  say(find('control'), told.control || 'nobody', told.control && !holds(told) ? 'warn' : '');
  say(find('fallback'), told.fallback || '-');
  for (const button of find('modes').children) button.classList.toggle('on', button.dataset.verb === told.mode);
}

function link() {
  const {told} = state;
  const silent = told ? Object.keys(told.nodes).find((name) => told.nodes[name] === 'silent') : '';
  const lost = !me.open ? 'lost' : late() ? 'late' : !told || !told.present ? 'no ACU' : silent ? `no ${silent}` : 'live';
  const stepped = told && told.steps > 0;
  say(find('time-label'), `${state.now && state.now.t < 1e8 ? 'time' : 'UTC'}${stepped ? ', clock stepped' : ''}`,
      stepped ? 'label warn' : 'label');
  say(find('link'), state.replay ? 'recording' : lost, lost === 'live' || state.replay ? '' : 'bad');
  say(find('role'), `${me.role || 'page'}, your name`, 'label');
  if (document.activeElement !== find('name')) find('name').value = me.name;
}

export function begin() {
  const hold = new Jog();
  const stop = new Stop();
  const preset = find('preset').elements;
  press(find('preset').querySelector('button'), 'preset', () => {
    const angles = ['azimuth', 'elevation'].map((axis) => Number(preset[axis].value.replace(',', '.')));
    const empty = ['azimuth', 'elevation'].some((axis) => preset[axis].value.trim() === '');
    if (empty || !angles.every(Number.isFinite)) { saying('preset: two angles in degrees are needed', true); return; }
    ask('preset', {azimuth: angles[0] * RADIANS, elevation: angles[1] * RADIANS});
  });
  press(find('take'), 'take', () => ask('take', me.role === 'supervisor' ? {role: 'supervisor'} : {}));
  press(find('release'), 'release', () => ask('release'));
  press(find('reset'), 'reset', () => ask('reset'));
  for (const name of FALLBACKS) find('choose-fallback').appendChild(make('option', '', name));
  find('choose-fallback').onchange = (event) => ask('fallback', {mode: event.target.value});
  find('name').onchange = (event) => rename(event.target.value);
  let known = '';
  const refresh = () => {
    link();
    for (const button of document.querySelectorAll('[data-verb]')) offer(button, refusal(button.dataset.verb));
    const {told} = state;
    const taken = told && !holds(told) && me.role !== 'supervisor' ? `held by ${told.control}` : '';
    offer(find('take'), refusal('take') || taken || (told && told.control && holds(told) ? 'it is yours' : ''));
    offer(find('release'), refusal('release') || (told && told.control === '' ? 'nobody has it' : ''));
    offer(find('reset'), refusal('reset'));
    hold.offer();
    find('stop').disabled = Boolean(state.replay);
    find('choose-fallback').disabled = Boolean(refusal('fallback'));
  };
  onState((came) => {
    if (came.fixed && known !== came.fixed.modes.join()) {
      known = came.fixed.modes.join();
      modes(came.fixed.modes);
    }
    if (came.told) {
      head(came);
      if (document.activeElement !== find('choose-fallback')) find('choose-fallback').value = came.told.fallback;
    }
    for (const reply of came.replies || []) {
      stop.heard(reply);
      if (reply.error) saying(reply.error, true);
      if (reply.verb) saying(`${reply.verb}: ${reply.reply}`, !reply.granted);
    }
    if (came.told || came.replies || !me.open) refresh();
  });
  setInterval(() => {
    refresh();
    if (me.stranger) warn('The server was started anew: open the address that it has printed.');
  }, 500);
}
