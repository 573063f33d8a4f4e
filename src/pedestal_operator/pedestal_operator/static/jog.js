// The jog: the page repeats the rates while a button is held, by pointer or by Space or Enter. When the button is
// released, or the page is hidden, loses focus or closes, the repetition ends and the axes stop.
import {jog} from './link.js';
import {refusal} from './refusals.js';
import {find, make} from './text.js';

const JOG_PERIOD_MS = 200;
const JOG_RATES_DEG_S = [0.1, 0.2, 0.5, 1, 2, 5];
const HOLD_KEYS = [' ', 'Enter'];

export class Jog {
  // showRefusal(reason): called when a button is pressed in vain.
  constructor(showRefusal) {
    this.showRefusal = showRefusal;
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
      button.onkeydown = (event) => {
        if (!HOLD_KEYS.includes(event.key)) return;
        event.preventDefault();
        if (!event.repeat) this.hold(button);
      };
      button.onkeyup = (event) => {
        if (!HOLD_KEYS.includes(event.key)) return;
        event.preventDefault();
        this.release();
      };
      button.onblur = () => this.release();
      button.oncontextmenu = (event) => event.preventDefault();
    }
    window.addEventListener('blur', () => this.release());
    document.addEventListener('visibilitychange', () => this.release());
  }

  hold(button) {
    this.release();
    const reason = refusal('rate');
    if (reason) { this.showRefusal(reason); return; }
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
}
