// Page of the operator: each module shows its part of the state, which arrives over the link.
import * as axes from './axes.js';
import * as charts from './charts.js';
import * as figures from './figures.js';
import * as hands from './hands.js';
import * as header from './header.js';
import * as link from './link.js';
import * as lists from './lists.js';
import * as loss from './loss.js';
import * as night from './night.js';
import * as replay from './replay.js';
import * as sky from './sky.js';

for (const part of [header, hands, axes, charts, sky, night, lists, replay, figures, loss, link]) part.begin();
