// The web socket: what the antenna tells comes in, what the user asks goes out.

const AGAIN = 1000;  // ms until the next try after the link was lost
const SILENT = 1000;  // ms without a state after which the page no longer shows the present

export const state = {now: null, told: null, fixed: null, sky: null, alarms: [], log: [], replay: null};
export const me = {name: localStorage.getItem('name') || '', role: '', open: false, stranger: false};

const takers = [];
let socket = null;
let heard = 0;
let number = 0;

// take(sections that came, state): called for every message.
export function onState(take) { takers.push(take); }

export function late() { return performance.now() - heard > SILENT; }

export function send(message) {
  if (!me.open) return false;
  socket.send(JSON.stringify(message));
  return true;
}

// Ask the control unit for a verb; its arguments in SI units, as on acu/command.
export function ask(verb, given = {}) { return send({ask: verb, arguments: given, id: ++number}); }

export function jog(rates) { return send({jog: rates}); }

export function rename(name) {
  me.name = name;
  localStorage.setItem('name', name);
  socket.close();
}

export function connect() {
  socket = new WebSocket(`ws://${location.host}/socket?name=${encodeURIComponent(me.name)}`);
  socket.onopen = () => { me.open = true; };
  socket.onclose = async () => {
    me.open = false;
    for (const take of takers) take({}, state);
    me.stranger = await fetch('page.css', {method: 'HEAD'}).then((answer) => answer.status === 401, () => false);
    setTimeout(connect, AGAIN);
  };
  socket.onmessage = (event) => {
    const sections = JSON.parse(event.data);
    send({seen: sections.number});  // which asks for the next one
    heard = performance.now();
    for (const reply of sections.replies || []) {
      if (reply.you) {
        me.name = reply.you;
        me.role = reply.role;
        localStorage.setItem('name', me.name);
      }
    }
    Object.assign(state, sections);
    for (const take of takers) take(sections, state);
  };
}
