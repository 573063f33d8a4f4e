// Refusals of commands, as the server derives them from the state of the antenna.
import {condition, me, state} from './link.js';

// Return true if this user may command: the user holds control, or control is free.
export function mayCommand({control}) { return control === '' || control.startsWith(`${me.name}@page `); }

// Return the reason why a command would be refused now, '' without a reason.
export function refusal(verb) {
  if (state.replay) return 'recording';
  if (condition() !== 'live') return 'no link';
  if (!state.status) return 'no state received';
  const {holder, other} = state.status.refused;
  return me.refused[verb] || (mayCommand(state.status) ? holder : other)[verb] || '';
}
