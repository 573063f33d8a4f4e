// The web socket: what the antenna tells comes in, what the user asks goes out.

const AGAIN = 1000;  // ms until the next try after the link was lost
const SILENT = 1000;  // ms without a state after which the page no longer shows the present
const DRAWN = 50;  // ms between two drawings, as often as a state comes

export const state = {now: null, told: null, fixed: null, sky: null, alarms: [], log: [], replay: null};
export const me = {name: localStorage.getItem('name') || '', role: '', open: false, stranger: false};

const takers = [];
const drawers = [];
let undrawn = {};  // the sections that came since the last drawing
let socket = null;
let heard = 0;
let newest = 0;  // number of the last message
let seen = 0;  // that the server knows of
let number = 0;

// take(sections that came, state): called for every message.
export function onState(take) { takers.push(take); }

// draw(sections that came since the last time, state): called DRAWN apart, while the page is seen.
export function onDraw(draw) { drawers.push(draw); }

function drawNow() {
  see();
  if (document.hidden || !Object.keys(undrawn).length) return;
  const came = undrawn;
  undrawn = {};
  for (const draw of drawers) draw(came, state);
}

export function late() { return performance.now() - heard > SILENT; }

export function send(message) {
  if (!me.open) return false;
  socket.send(JSON.stringify(message));
  return true;
}

// Ask the control unit for a verb; its arguments in SI units, as on acu/command.
export function ask(verb, given = {}) { return send({ask: verb, arguments: given, id: ++number}); }

export function jog(rates) {
  see();
  return send({jog: rates});
}

// Say what was seen, which asks for the next ones.
function see() {
  if (seen !== newest && send({seen: newest})) seen = newest;
}

export function rename(name) {
  me.name = name;
  localStorage.setItem('name', name);
  socket.close();
}

export function begin() {
  setInterval(drawNow, DRAWN);
  connect();
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket?name=${encodeURIComponent(me.name)}`);
  socket.onopen = () => {
    me.open = true;
    seen = newest = 0;
  };
  socket.onclose = async () => {
    me.open = false;
    for (const take of takers) take({}, state);
    me.stranger = await fetch('page.css', {method: 'HEAD'}).then((answer) => answer.status === 401, () => false);
    setTimeout(connect, AGAIN);
  };
  socket.onmessage = (event) => {
    const sections = JSON.parse(event.data);
    newest = sections.number;
    if (document.hidden) see();  // browsers hold up the timers of hidden pages, some for a minute
    heard = performance.now();
    for (const reply of sections.replies || []) {
      if (reply.you) {
        me.name = reply.you;
        me.role = reply.role;
        localStorage.setItem('name', me.name);
      }
    }
    Object.assign(state, sections);
    Object.assign(undrawn, sections);
    for (const take of takers) take(sections, state);
  };
}
