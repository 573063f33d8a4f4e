// STOP, and what the page shows without a link: the overlay before the first state, the dimmed page and the banner later.
import {age, condition, lossCause, me, onState, request, state} from './link.js';
import {find, setText} from './text.js';

const STOP_REPLY_TIMEOUT_MS = 1500;
const LOOK_PERIOD_MS = 200;
const NO_LINK_STOP = 'STOP was not sent: no link.';
const LOST_STOP = 'STOP on this page does nothing now.';
const EMERGENCY_STOP = 'Use the emergency stop of the antenna.';

let stopTime = null;  // of a STOP without a reply
let stopProblem = '';

function showLoss() {
  const present = condition();
  document.documentElement.dataset.link = present;
  find('overlay').hidden = present !== 'none';
  document.querySelector('main').inert = present === 'none';
  if (present === 'none') {
    setText(find('overlay-cause'), lossCause());
    setText(find('overlay-help'), '');
  }
  showStop();
  const lost = present === 'lost' ? `No link to the antenna. ${lossCause()} ${LOST_STOP}`
    : present === 'stale' ? 'No state arrives from the server.' : '';
  const help = stopProblem || present === 'lost' ? EMERGENCY_STOP : '';
  find('banner').hidden = !(stopProblem || lost);
  setText(find('banner-text'), [stopProblem, lost, help].filter(Boolean).join(' '));
  setText(find('banner-age'), lost ? `Data ${age().toFixed(0)} s old` : '');
}

function showStop() {
  const stop = find('stop');
  stop.disabled = Boolean(state.replay);
  stop.classList.toggle('dead', !me.open || stop.disabled);
  stop.setAttribute('aria-disabled', String(!me.open || stop.disabled));  // a press still shows the emergency stop
  stop.title = stop.disabled ? 'recording' : me.open ? '' : `${LOST_STOP} ${EMERGENCY_STOP}`;
}

function look() {
  if (stopTime !== null && performance.now() - stopTime > STOP_REPLY_TIMEOUT_MS) {
    stopTime = null;
    stopProblem = 'STOP has no reply.';
  }
  showLoss();
}

export function begin() {
  find('stop').onclick = () => {
    stopTime = request('stop') ? performance.now() : null;
    if (stopTime === null) stopProblem = NO_LINK_STOP;
    showLoss();
  };
  onState((sections) => {
    for (const reply of sections.replies || []) {
      if (['stop', 'standby'].includes(reply.verb) && reply.granted) {
        stopTime = null;
        stopProblem = '';
      }
    }
    if (sections.replies || sections.replay || !me.open || find('overlay').hidden === false) showLoss();
  });
  setInterval(look, LOOK_PERIOD_MS);
}
