// The web socket: it receives the state of the antenna and sends the commands of the user.

const RECONNECT_DELAY_MS = 1000;  // after a loss of the link
const MAX_STATE_AGE_MS = 1000;  // after which the state on the page is stale
const DRAW_PERIOD_MS = 50;  // equal to the period of the state

export const state = {now: null, status: null, fixed: null, sky: null, alarms: [], log: [], replay: null};
export const me = {name: localStorage.getItem('name') || '', role: '', open: false, unauthorized: false};

const receivers = [];
const drawers = [];
let undrawn = {};  // sections received since the last drawing
let socket = null;
let lastArrival = 0;
let newest = 0;  // number of the last received message
let acknowledged = 0;  // number of the last acknowledged message
let requestNumber = 0;

// Call take(received sections, state) for every message.
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

export function isStale() { return performance.now() - lastArrival > MAX_STATE_AGE_MS; }

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
  socket.close();
}

export function begin() {
  setInterval(drawNow, DRAW_PERIOD_MS);
  connect();
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket?name=${encodeURIComponent(me.name)}`);
  socket.onopen = () => {
    me.open = true;
    acknowledged = newest = 0;
  };
  socket.onclose = async () => {
    me.open = false;
    for (const take of receivers) take({}, state);
    me.unauthorized = await fetch('page.css', {method: 'HEAD'}).then((answer) => answer.status === 401, () => false);
    setTimeout(connect, RECONNECT_DELAY_MS);
  };
  socket.onmessage = (event) => {
    const sections = JSON.parse(event.data);
    newest = sections.number;
    if (document.hidden) acknowledge();  // browsers delay the timers of hidden pages, some for a minute
    lastArrival = performance.now();
    for (const reply of sections.replies || []) {
      if (reply.you) {
        me.name = reply.you;
        me.role = reply.role;
        localStorage.setItem('name', me.name);
      }
    }
    Object.assign(state, sections);
    Object.assign(undrawn, sections);
    for (const take of receivers) take(sections, state);
  };
}
