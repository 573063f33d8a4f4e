// Slider, speed and play button of a recording.
import {onDraw, send, state} from './link.js';
import {find, make, setText} from './text.js';

const SPEEDS = [0.2, 0.5, 1, 2, 5, 10];

export function begin() {
  const slider = find('slider');
  let held = false;
  for (const speed of SPEEDS) {
    const option = make('option', '', `${speed} ×`);
    option.value = speed;
    find('speed').appendChild(option);
  }
  slider.onpointerdown = () => { held = true; };
  slider.onpointerup = () => { held = false; };
  slider.oninput = () => send({replay: {position: Number(slider.value)}});
  find('play').onclick = () => send({replay: {playing: !state.replay.playing}});
  find('speed').onchange = (event) => send({replay: {rate: Number(event.target.value)}});
  onDraw((sections) => {
    if (!sections.replay) return;
    const {length, position, playing, rate} = sections.replay;
    find('replay').hidden = false;
    slider.max = length;
    if (!held) slider.value = position;
    setText(find('position'), `${position.toFixed(1)} of ${length.toFixed(1)} s`);
    setText(find('play'), playing ? 'pause' : 'play');
    find('speed').value = rate;
  });
}
