// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The time machine: look back, branch, and see the trajectories side by side; a bag is played here, too.

import {colours, linkColour, solverColour} from './colours.js';
import {Brush, fit, View} from './draw.js';
import {at, joints, tip} from './geometry.js';
import {clamp, element, find, number, short, solverName} from './dom.js';
import {pastOf} from './plots.js';
import {Stream} from './stream.js';

const PAUSE = 0.8;     // [s] for which the trajectories stand at their end
const SEEK = 60;       // [ms] between two seeks while the slider moves
const SEEN = 1.2;      // times what plots show, before an instant
const INSET = 8;       // [px] of the slider's ends
const AXIS = 16;       // [px] below the strip
const STEPS = [0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600];   // [s] between ticks
const APART = 56;      // [px] between ticks at least

export class Timeline {
  history = null;      // the rows of the last minute while one looks back
  past = null;         // a stream whose newest frame is that of the instant that is looked at
  n = 0;               // the row of that instant
  asking = false;
  trajectories = null;
  sought = 0;

  constructor(socket, stream, say) {
    Object.assign(this, {socket, stream, say});
    this.slider = find('#instant');
    this.slider.addEventListener('input', () => this.scrub());
    find('#look').addEventListener('click', () => this.toggle());
    find('#branch').addEventListener('click', () => this.branch());
    find('#close-trajectories').addEventListener('click', () => this.close());
    find('#play').addEventListener('click', () => this.play(!this.playing));
    find('#rate').addEventListener('change', () => this.play(true));
    socket.on('branch', message => this.onBranch(message));
    socket.on('closed', () => this.live());
  }

  configure(hello) {
    this.hello = hello;
    find('#look').hidden = hello.replay;
    for (const control of document.querySelectorAll('.of-bag')) control.hidden = !hello.replay;
    this.slider.disabled = !hello.replay && !this.history;
    if (hello.replay) {
      Object.assign(this.slider, {min: 0, max: hello.duration, step: 'any'});
      this.ask();
    }
    find('#branch').disabled = !hello.replay && !this.history;
  }

  async ask() {
    const history = await this.socket.ask({do: 'history'});
    if (!history.t?.length) {
      this.say({ok: false, text: history.text || 'there is nothing to look back at yet'});
      return null;
    }
    this.rows = rowsOf(history);
    if (this.hello.replay) this.stream.precede(this.before(this.stream.times[0] ?? 0));
    this.drawStrip();
    return this.rows;
  }

  /** Return the rows of the seconds before a time [s]. */
  before(time) {
    const first = time - SEEN * pastOf(this.hello.scale);
    return this.rows?.filter(({t}) => t < time && t > first) ?? [];
  }

  toggle() {
    if (this.hello?.replay) return null;   // it is all past
    return this.history ? this.live() : this.look();
  }

  /** Stop, and look at the last minute. */
  async look() {
    const history = await this.ask();
    if (!history) return;
    this.history = history;
    const [first, last] = [history[0].t, history.at(-1).t];
    Object.assign(this.slider, {min: first - last, max: 0, step: 'any', disabled: false});
    find('#look').textContent = 'Back to live';
    find('#look').setAttribute('aria-pressed', 'true');
    find('#branch').disabled = false;
    document.documentElement.classList.add('looking-back');
    this.drawStrip();   // which has a size now
    this.goTo(history.length - 1);
    this.slider.focus();
  }

  live() {
    if (!this.history) return;
    this.history = this.past = this.rows = null;
    Object.assign(this.slider, {value: this.slider.max, disabled: true});
    find('#look').textContent = 'Look back';
    find('#look').setAttribute('aria-pressed', 'false');
    find('#branch').disabled = true;
    document.documentElement.classList.remove('looking-back');
    find('#instant-time').textContent = 'live';
    this.drawStrip();
    if (!find('#trajectories').hidden) find('#thoughts-tab').click();   // they stay until they are closed
  }

  scrub() {
    const value = Number(this.slider.value);
    if (this.history) {
      const time = this.history.at(-1).t + value, next = this.history.findIndex(({t}) => t >= time);
      const [a, b] = [Math.max(next - 1, 0), Math.max(next, 0)];
      this.goTo(time - this.history[a].t < this.history[b].t - time ? a : b);
      return;
    }
    if (this.playing) this.play(false);   // who seeks wants to look
    this.seek(value);
    this.showTime();
  }

  /** Look at a state of the last minute. */
  goTo(n) {
    this.n = clamp(n, 0, this.history.length - 1);
    this.slider.value = this.at - this.history.at(-1).t;
    this.showTime();
    this.recall();
  }

  /** The time [s] of the instant that is looked at. */
  get at() {
    return this.history[this.n].t;
  }

  /** Ask for what was thought at the instant, and then for where one has gone meanwhile. */
  async recall() {
    if (this.asking) return;
    this.asking = true;
    const {history, at} = this, {frame, text} = await this.socket.ask({do: 'past', at});
    this.asking = false;
    if (!this.history) return;
    if (this.history === history) {
      if (!frame) this.say({ok: false, text});
      this.past = new Stream(this.hello.scale);
      this.past.push(frame ?? history.find(({t}) => t === at), performance.now());
      this.past.precede(this.before(at));
    }
    if (this.history !== history || this.at !== at) this.recall();
  }

  seek(value) {
    clearTimeout(this.seeking);
    const left = this.sought + SEEK - performance.now();
    if (left > 0) { this.seeking = setTimeout(() => this.seek(value), left); return; }
    this.sought = performance.now();
    this.stream.clear();
    this.socket.send({do: 'seek', id: 0, at: value});
  }

  async play(on) {
    const rate = Number(find('#rate').value);
    const answer = await this.socket.ask({do: 'play', on, rate});
    if (!answer.ok) this.say(answer);
  }

  /** Go a state on or back, by the keys. */
  step(way) {
    if (this.history) this.goTo(this.n + way);
    else {
      this.stream.clear();
      this.socket.send({do: 'skip', id: 0, states: way});
    }
  }

  showTime() {
    const value = Number(this.slider.value);
    const text = this.hello.replay ? `${number(value)} of ${number(this.hello.duration)} s`
      : `${number(value)} s`;
    find('#instant-time').textContent = text;
    this.slider.setAttribute('aria-valuetext', text);
  }

  /** Follow the clock of a bag. */
  onFrame(frame) {
    if (!this.hello?.replay) return;
    if (this.stream.frames.length === 1) this.stream.precede(this.before(frame.t));
    this.playing = !frame.paused;
    find('#play').textContent = this.playing ? 'Pause' : 'Play';
    if (!this.slider.matches(':active') || this.playing) this.slider.value = frame.t;
    this.showTime();
  }

  drawStrip() {
    const {pen, width, height} = fit(find('#strip'));
    const {lengths} = this.hello ?? {};
    if (!this.rows || !lengths) return;
    const reach = lengths.reduce((a, b) => a + b), low = height - AXIS;
    const first = this.rows[0].t, span = this.rows.at(-1).t - first || 1;
    const left = time => INSET + (time - first) / span * (width - 2 * INSET);
    pen.beginPath();
    for (const {t, x} of this.rows) {
      if (!x.every(Number.isFinite)) continue;
      pen.lineTo(left(t), (1 - tip(x, lengths)[1] / reach) / 2 * (low - 4) + 2);
    }
    [pen.strokeStyle, pen.lineWidth] = [linkColour(lengths.length - 1), 1.2];
    pen.globalAlpha = 0.6;
    pen.stroke();
    pen.globalAlpha = 1;
    this.drawAxis(pen, {left, width, low, zero: this.hello.replay ? first : first + span,
                        from: first, to: first + span});
  }

  /** Mark the seconds below the strip: of a bag from its first state on, else those before now. */
  drawAxis(pen, {left, width, low, zero, from, to}) {
    const least = APART * (to - from) / (width - 2 * INSET);
    const step = STEPS.find(each => each >= least) ?? STEPS.at(-1);
    [pen.font, pen.textBaseline, pen.lineWidth] = ['11px system-ui, sans-serif', 'top', 1];
    [pen.strokeStyle, pen.fillStyle] = [colours.faint, colours.faint];
    pen.beginPath();
    for (let n = Math.ceil((from - zero) / step - 1e-6); n * step <= to - zero + 1e-6; n++) {
      const x = left(zero + n * step), text = `${number(n * step, step < 1 ? 1 : 0)} s`;
      pen.moveTo(x, low);
      pen.lineTo(x, low + 4);
      pen.textAlign = x < 24 ? 'left' : x > width - 24 ? 'right' : 'center';
      pen.fillText(text, clamp(x, 0, width), low + 5);
    }
    pen.stroke();
  }

  async branch() {
    const at = this.hello.replay ? Number(this.slider.value) : this.at;
    const duration = Number(find('#branch-duration').value);
    find('#progress').hidden = false;
    find('#progress').value = 0;
    find('#branch').disabled = true;
    this.say({ok: true, text: 'each solver takes over from there …'});
    const answer = await this.socket.ask({do: 'branch', at, duration});
    if (!answer.ok) this.fail(answer.text);
  }

  fail(text) {
    find('#progress').hidden = true;
    find('#branch').disabled = !this.hello.replay && !this.history;
    this.say({ok: false, text});
  }

  onBranch({progress, trajectories, text}) {
    if (progress !== undefined) find('#progress').value = progress;
    if (trajectories) this.show(trajectories);
    else if (text) this.fail(text);
  }

  show(trajectories) {
    find('#progress').hidden = true;
    find('#branch').disabled = !this.hello.replay && !this.history;
    const least = Math.min(...Object.values(trajectories).map(({cost}) => cost ?? Infinity));
    this.trajectories = Object.entries(trajectories).map(([name, trajectory], n) => {
      const solver = name.split(' ').at(-1), canvas = element('canvas', {
        role: 'img', 'aria-label': `what ${name} did from there on`});
      const title = name.split(' ').map(solverName).join(' ');
      const caption = element('figcaption', {}, element('b', {textContent: title}),
        element('span', {textContent: `cost ${short(trajectory.cost)}`}),
        element('span', {textContent: trajectory.cost === least ? 'the least'
          : `regret ${short(trajectory.regret)}`}),
        element('span', {textContent: Number.isFinite(trajectory.settled)
          ? 'held to the end' : 'not held at the end'}));
      const figure = element('figure', {className: trajectory.cost === least ? 'best' : ''}, canvas, caption);
      figure.style.setProperty('--chip', solverColour(solver, n));
      return {...trajectory, name, solver, canvas, figure};
    });
    this.duration = Math.max(...this.trajectories.map(({t}) => t.at(-1) - t[0]));
    find('#trajectories-list').replaceChildren(...this.trajectories.map(({figure}) => figure));
    find('#trajectories-tab').hidden = false;
    find('#trajectories-tab').click();
    find('#trajectories').scrollIntoView({block: 'start'});
    this.say({ok: true, text: `${this.trajectories.length} trajectories from there on, side by side`});
  }

  close() {
    this.trajectories = null;
    find('#trajectories-tab').hidden = true;
    find('#thoughts-tab').click();
  }

  /** Draw the trajectories at the same time after the branch, over and over. */
  draw(now) {
    if (!this.trajectories || !this.hello || find('#trajectories').hidden) return;
    const {limits, lengths, cart, scale} = this.hello, reach = lengths.reduce((a, b) => a + b);
    const side = Math.min(limits.track ?? 3 * scale.length, 12 * scale.length);
    const after = Math.min(now / 1000 % (this.duration + PAUSE), this.duration);
    find('#trajectories-time').textContent = `+${number(after, 1)} s`;
    for (const {t, X, U, canvas, solver} of this.trajectories) {
      const {pen, width, height} = fit(canvas), time = t[0] + after;
      const view = new View(width, height, side + cart[0], 1.15 * reach);
      const brush = new Brush(pen, view, scale);
      brush.track(limits, cart, false);
      const n = clamp(t.findIndex(each => each > time) - 1, 0, t.length - 1);
      const until = t.at(-1) <= time ? X.length : n + 1;
      brush.line(X.slice(0, until).filter(x => x.every(Number.isFinite)).map(x => tip(x, lengths)),
                 solverColour(solver), 1.5, 0.6);
      const x = at(time, t, X, scale.length);
      if (!x?.every(Number.isFinite)) continue;
      const places = joints(x, lengths);
      brush.pendulum(places, cart, this.hello.centres);
      brush.arrow(places[0], U[Math.min(n, U.length - 1)], colours.force, cart[0] / 2);
    }
  }
}

/** Return the rows of a history, as frames have them: without plan and estimate. */
function rowsOf({t, x, u, force, push, figures}) {
  const row = n => Object.fromEntries(
    Object.entries(figures).map(([name, values]) => [name, values[n]]));
  return t.map((time, n) => ({
    t: time, time: null, x: x[n], u: u[n], force: force[n], push: push[n], tick: row(n)}));
}
