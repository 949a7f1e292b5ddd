// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Draws the pendulum of each `.player` from its JSON: play, pause, drag the slider.
'use strict';
const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name);

for (const player of document.querySelectorAll('.player')) {
  const run = JSON.parse(player.querySelector('script').textContent);
  const canvas = player.querySelector('canvas'), pen = canvas.getContext('2d');
  const slider = player.querySelector('input'), button = player.querySelector('button');
  const reach = 1.15 * (run.lengths[0] + run.lengths[1]), last = run.states.length - 1;
  const wall = run.track === null ? 1e3 : run.track + 0.22;
  let now = 0, before = null;  // [frames], [ms] of the last drawing while it plays

  const places = ([x, first, second]) => {
    const tip = [x + run.lengths[0] * Math.sin(first), run.lengths[0] * Math.cos(first)];
    return [[x, 0], tip, [tip[0] + run.lengths[1] * Math.sin(second),
                          tip[1] + run.lengths[1] * Math.cos(second)]];
  };
  const line = (points, style, width) => {
    [pen.strokeStyle, pen.lineWidth] = [style, width];
    pen.stroke(new Path2D('M' + points.map(place => place.join(' ')).join('L')));
  };
  const trail = end => {
    for (let n = Math.max(1, end - Math.round(1 / run.period)); n <= end; n++) {
      if (run.states[n - 1] === null || run.states[n] === null) continue;
      pen.globalAlpha = 0.7 * (1 - (end - n) * run.period) ** 1.5;
      line([places(run.states[n - 1])[2], places(run.states[n])[2]], colour('--link2'), 0.025);
    }
    pen.globalAlpha = 1;
  };
  const arrow = (x, u) => {
    if (Math.abs(u) < 0.5) return;
    const way = Math.sign(u), from = x + 0.26 * way, to = from + 0.05 * u;
    const neck = to - way * Math.min(0.18, 0.05 * Math.abs(u)), wing = (to - neck) / 2;
    line([[from, 0], [neck, 0]], colour('--force'), 0.05);
    pen.fillStyle = colour('--force');
    pen.fill(new Path2D(`M${to} 0L${neck} ${wing}L${neck} ${-wing}Z`));
  };
  const draw = () => {
    const frame = Math.round(now), state = run.states[frame], u = run.forces[frame];
    slider.value = frame;
    player.querySelector('output').textContent = `${(frame * run.period).toFixed(2)} s, ` +
      (u === null ? '-' : `${u.toFixed(1).replace('-', '−')} N`);
    const most = canvas.clientWidth > 600 ? 2.1 : 1.3, half = Math.max(run.half_width, most * reach);
    canvas.width = canvas.clientWidth * devicePixelRatio;
    canvas.height = canvas.width * reach / half;
    const scale = canvas.width / 2 / half;
    pen.setTransform(scale, 0, 0, -scale, canvas.width / 2, canvas.height / 2);
    line([[-wall, -0.15], [wall, -0.15]], colour('--faint'), 0.02);
    for (const stop of [-wall, wall]) line([[stop, -0.15], [stop, 0.1]], colour('--faint'), 0.04);
    if (state === null) return;
    trail(frame);
    pen.lineCap = 'round';
    const [cart, first, second] = places(state);
    pen.fillStyle = colour('--cart');
    pen.fillRect(cart[0] - 0.22, -0.11, 0.44, 0.22);
    arrow(cart[0], u);
    line([cart, first], colour('--link1'), 0.07);
    line([first, second], colour('--link2'), 0.07);
  };
  const step = time => {
    if (before === null) return;
    now = Math.min(now + (time - before) / 1000 / run.period, last);
    before = time;
    draw();
    now < last ? requestAnimationFrame(step) : pause();
  };
  const pause = () => { [before, button.textContent] = [null, 'Play']; };
  const play = () => {
    if (now === last) now = 0;
    [before, button.textContent] = [performance.now(), 'Pause'];
    requestAnimationFrame(step);
  };
  button.addEventListener('click', () => before === null ? play() : pause());
  slider.addEventListener('input', () => { pause(); now = Number(slider.value); draw(); });
  addEventListener('resize', draw);
  draw();
}
