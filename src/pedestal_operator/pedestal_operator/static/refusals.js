// Refusals of commands, as the server derives them from the state of the antenna.
import {condition, me, state} from './link.js';
import {find, setText} from './text.js';

// Return true if this user may command: the user holds control, or control is free.
export function mayCommand({control}) { return control === '' || control.startsWith(`${me.name}@page `); }

// Return the reason why a command would be refused now, '' without a reason.
export function refusal(verb) {
  if (state.replay) return 'recording';
  if (condition() !== 'live') return 'no link';
  if (!state.status) return 'no state received';
  const client = mayCommand(state.status) ? 'holder' : me.role === 'supervisor' ? 'supervisor' : 'other';
  return me.refused[verb] || state.status.refused[client][verb] || '';
}

// Show a text about the last command.
export function showMessage(text, bad = false) {
  setText(find('message'), text, bad ? 'warn' : '');
  find('message').title = text;
}

// Let a button act if its command would be accepted, and show the reason of the refusal else.
export function press(button, verb, act) {
  button.dataset.verb = verb;
  button.onclick = (event) => {
    event.preventDefault();
    const reason = refusal(verb);
    if (reason) showMessage(`${verb}: ${reason}`, true); else act();
  };
}
