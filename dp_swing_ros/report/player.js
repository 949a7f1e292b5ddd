// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Draws the pendulum of each `.player` from its JSON: play, pause, drag the slider.
'use strict';

for (const player of document.querySelectorAll('.player')) {
  const run = JSON.parse(player.querySelector('script').textContent);
  const canvas = player.querySelector('canvas'), pen = canvas.getContext('2d');
  const slider = player.querySelector('input'), button = player.querySelector('button');
  const last = run.joints.length - 1, [width, height] = run.cart;
  let now = 0, before = null;  // [frames], [ms] of the last drawing while it plays

  const line = (points, colour, thickness) => {   // [m] where links have 1 m
    [pen.strokeStyle, pen.lineWidth] = [colour, thickness * run.size];
    pen.stroke(new Path2D('M' + points.map(point => point.join(' ')).join('L')));
  };
  const dot = place => {
    const disc = new Path2D();
    disc.arc(...place, 0.04 * run.size, 0, 2 * Math.PI);
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [run.colours.cart, 'white', 0.02 * run.size];
    pen.stroke(disc);
    pen.fill(disc);
  };
  const trail = end => {
    for (let n = Math.max(1, end - Math.round(run.trail / run.period)); n <= end; n++) {
      if (run.joints[n - 1] === null || run.joints[n] === null) continue;
      pen.globalAlpha = 0.7 * Math.max(1 - (end - n) * run.period / run.trail, 0) ** 1.5;
      line([run.joints[n - 1].at(-1), run.joints[n].at(-1)], run.links.at(-1), 0.025);
    }
    pen.globalAlpha = 1;
  };
  const arrow = (x, u) => {
    if (Math.abs(u) < run.arrow.least) return;
    const way = Math.sign(u), from = x + (width / 2 + run.arrow.gap) * way;
    const length = run.arrow.scale * u, head = Math.min(run.arrow.head, Math.abs(length));
    const to = from + length, neck = to - way * head;
    line([[from, 0], [neck, 0]], run.colours.force, 0.05);
    pen.fillStyle = run.colours.force;
    pen.fill(new Path2D(`M${to} 0L${neck} ${head / 2}L${neck} ${-head / 2}Z`));
  };
  const draw = () => {
    const frame = Math.round(now), joints = run.joints[frame], u = run.forces[frame];
    slider.value = frame;
    player.querySelector('output').textContent = `${(frame * run.period).toFixed(2)} s, ` +
      (u === null ? '-' : `${u.toFixed(run.digits).replace('-', '−')} ${run.unit}`);
    const most = canvas.clientWidth > 600 ? 2.1 : 1.3;
    const half = Math.max(run.half_width, most * run.reach);
    canvas.width = canvas.clientWidth * devicePixelRatio;
    canvas.height = canvas.width * run.reach / half;
    const scale = canvas.width / 2 / half;
    pen.setTransform(scale, 0, 0, -scale, canvas.width / 2, canvas.height / 2);
    run.track.forEach((points, n) => line(points, run.colours.track, n ? 0.04 : 0.02));
    if (joints === null) return;
    trail(frame);
    pen.lineCap = 'round';
    const [x, z] = joints[0];
    pen.fillStyle = run.colours.cart;
    pen.fillRect(x - width / 2, z - height / 2, width, height);
    arrow(x, u);
    run.links.forEach((colour, n) => line(joints.slice(n, n + 2), colour, 0.07));
    run.centres.forEach((share, n) => {
      if (share !== null) dot(joints[n].map((from, i) => from + share * (joints[n + 1][i] - from)));
    });
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
