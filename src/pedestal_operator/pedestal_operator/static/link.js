// The web socket: it receives the state of the antenna and sends the commands of the user.

const RECONNECT_DELAY_MS = 1000;  // after a loss of the link
const MAX_STATE_AGE_MS = 1000;  // after which the state on the page is stale
const SILENCE_TIMEOUT_MS = 5000;  // after which a silent web socket counts as lost, as on the server
const DRAW_PERIOD_MS = 50;  // equal to the period of the state

export const state = {now: null, status: null, fixed: null, sky: null, night: null, alarms: [], log: [], replay: null};
export const me = {name: localStorage.getItem('name') || '', role: '', refused: {}, open: false};

const receivers = [];
const drawers = [];
let undrawn = {};  // sections received since the last drawing
let socket = null;
let lastArrival = 0;  // of a state
let lastSign = 0;  // of the present web socket: its opening, or its last message
let newest = 0;  // number of the last received message
let acknowledged = 0;  // number of the last acknowledged message
let requestNumber = 0;
let cause = `Connecting to ${location.host}.`;

// Call take(received sections, state) for every message, and after a loss of the link.
export function onState(take) { receivers.push(take); }

// Call draw(sections since the last call, state) every DRAW_PERIOD_MS while the page is visible.
export function onDraw(draw) { drawers.push(draw); }

function drawNow() {
  acknowledge();
  if (document.hidden || !Object.keys(undrawn).length) return;
  const sections = undrawn;
  undrawn = {};
  for (const draw of drawers) draw(sections, state);
}

// Return the age of the state on the page [s].
export function age() { return (performance.now() - lastArrival) / 1000; }

// Return the condition of the link: none before the first state, lost without a web socket, stale, or live.
export function condition() {
  if (!state.now) return 'none';
  if (!me.open) return 'lost';
  return !state.replay && 1000 * age() > MAX_STATE_AGE_MS ? 'stale' : 'live';  // a paused recording sends nothing
}

// Return why the web socket is not open.
export function lossCause() { return cause; }

export function send(message) {
  if (!me.open) return false;
  socket.send(JSON.stringify(message));
  return true;
}

// Send a command to the control unit, with arguments in SI units as on acu/command.
export function request(verb, given = {}) { return send({ask: verb, arguments: given, id: ++requestNumber}); }

export function jog(rates) {
  acknowledge();
  return send({jog: rates});
}

// Acknowledge the last message; the server then sends the next one.
function acknowledge() {
  if (acknowledged !== newest && send({seen: newest})) acknowledged = newest;
}

export function rename(name) {
  me.name = name;
  localStorage.setItem('name', name);
  if (!socket) return;  // the next web socket has the name
  const old = socket;
  socket = null;
  me.open = false;
  old.close();
  connect();
}

export function begin() {
  setInterval(drawNow, DRAW_PERIOD_MS);
  setInterval(() => {
    if (me.open && !state.replay && performance.now() - lastSign > SILENCE_TIMEOUT_MS) {
      const silent = socket;
      lose(silent);
      silent.close();
    }
  }, MAX_STATE_AGE_MS);
  connect();
}

function connect() {
  const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
  const opened = new WebSocket(`${scheme}://${location.host}/socket?name=${encodeURIComponent(me.name)}`);
  socket = opened;
  opened.onopen = () => {
    if (socket !== opened) return;
    me.open = true;
    acknowledged = newest = 0;
    lastSign = performance.now();
  };
  opened.onclose = () => lose(opened);
  opened.onmessage = (event) => { if (socket === opened) receive(JSON.parse(event.data)); };
}

async function lose(lost) {
  if (socket !== lost) return;  // lost before, after its silence
  socket = null;
  me.open = false;
  for (const take of receivers) take({}, state);
  cause = await findCause();
  setTimeout(connect, RECONNECT_DELAY_MS);
}

// Return why the server accepts no web socket. The server judges a POST as it judges a web socket, but the browser shows
// only the answer to the POST. After the checks the server refuses the method of the POST (405).
async function findCause() {
  try {
    const answer = await fetch('page.css', {method: 'POST', signal: AbortSignal.timeout(SILENCE_TIMEOUT_MS)});
    if (answer.status === 405) {
      return 'The server answers, but opens no web socket: too many pages are open, or a proxy does not pass on web sockets.';
    }
    if ([400, 401, 403].includes(answer.status)) return `The server refuses this page: ${(await answer.text()).trim()}.`;
    return `${location.host} answers with the status ${answer.status} of HTTP.`;
  } catch {
    return `The server at ${location.host} does not answer.`;
  }
}

function receive(sections) {
  newest = sections.number;
  if (document.hidden) acknowledge();  // browsers delay the timers of hidden pages, some for a minute
  lastSign = performance.now();
  if (sections.now) lastArrival = lastSign;
  for (const reply of sections.replies || []) {
    if (reply.you) {
      me.name = reply.you;
      me.role = reply.role;
      me.refused = reply.refused;
      localStorage.setItem('name', me.name);
    }
  }
  Object.assign(state, sections);
  Object.assign(undrawn, sections);
  for (const take of receivers) take(sections, state);
}
