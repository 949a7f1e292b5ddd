// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The time machine: look back, branch, and see the courses side by side; a bag is played here, too.

import {colours, linkColour, solverColour} from './colours.js';
import {Brush, fit, View} from './draw.js';
import {at, joints, tip} from './geometry.js';
import {clamp, element, find, number, short, solverName} from './dom.js';

const REST = 0.8;      // [s] for which the courses stand at their end
const SEEK = 60;       // [ms] between two seeks while the slider moves

export class Timeline {
  history = null;      // {t, x, u, force} while one looks back
  at = 0;              // [s] the instant that is looked at
  courses = null;
  sought = 0;

  constructor(socket, stream, say) {
    Object.assign(this, {socket, stream, say});
    this.slider = find('#instant');
    this.slider.addEventListener('input', () => this.scrub());
    find('#look').addEventListener('click', () => this.toggle());
    find('#branch').addEventListener('click', () => this.branch());
    find('#close-courses').addEventListener('click', () => this.close());
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
    this.strip = history;
    this.drawStrip();
    return history;
  }

  toggle() {
    return this.history ? this.live() : this.look();
  }

  /** Stop, and look at the last minute. */
  async look() {
    const history = await this.ask();
    if (!history) return;
    this.history = history;
    const [first, last] = [history.t[0], history.t.at(-1)];
    Object.assign(this.slider, {min: first - last, max: 0, step: 'any', value: 0, disabled: false});
    this.at = last;
    find('#look').textContent = 'Back to live';
    find('#look').setAttribute('aria-pressed', 'true');
    find('#branch').disabled = false;
    document.documentElement.classList.add('looking-back');
    this.drawStrip();   // which has a size now
    this.showTime();
    this.slider.focus();
  }

  live() {
    if (!this.history) return;
    this.history = null;
    Object.assign(this.slider, {value: this.slider.max, disabled: true});
    find('#look').textContent = 'Look back';
    find('#look').setAttribute('aria-pressed', 'false');
    find('#branch').disabled = true;
    document.documentElement.classList.remove('looking-back');
    find('#instant-time').textContent = 'live';
    this.strip = null;
    this.drawStrip();
  }

  scrub() {
    const value = Number(this.slider.value);
    if (this.history) this.at = this.history.t.at(-1) + value;
    else {
      if (this.playing) this.play(false);   // who seeks wants to look
      this.seek(value);
    }
    this.showTime();
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
    this.slider.value = Number(this.slider.value) + way * (this.hello?.period ?? 0.05);
    this.scrub();
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
    this.playing = !frame.paused;
    find('#play').textContent = this.playing ? 'Pause' : 'Play';
    if (document.activeElement !== this.slider || this.playing) this.slider.value = frame.t;
    this.showTime();
  }

  /** Return what is to be drawn in place of the newest, null while live. */
  given() {
    if (!this.history) return null;
    const {t, x, u} = this.history, of = time => at(time, t, x);
    const n = clamp(t.findIndex(each => each >= this.at), 0, t.length - 1);
    return {t: this.at, x: of(this.at), at: of, u: u[n], push: 0};
  }

  drawStrip() {
    const {pen, width, height} = fit(find('#strip'));
    const {lengths} = this.hello ?? {};
    if (!this.strip || !lengths) return;
    const {t, x} = this.strip, reach = lengths.reduce((a, b) => a + b);
    const span = t.at(-1) - t[0] || 1;
    pen.beginPath();
    t.forEach((time, n) => {
      if (!x[n].every(Number.isFinite)) return;
      const high = tip(x[n], lengths)[1] / reach;
      pen.lineTo(8 + (time - t[0]) / span * (width - 16), (1 - high) / 2 * (height - 4) + 2);
    });
    [pen.strokeStyle, pen.lineWidth] = [linkColour(lengths.length - 1), 1.2];
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

  onBranch({progress, courses, text}) {
    if (progress !== undefined) find('#progress').value = progress;
    if (courses) this.show(courses);
    else if (text) this.fail(text);
  }

  show(courses) {
    find('#progress').hidden = true;
    find('#branch').disabled = !this.hello.replay && !this.history;
    const least = Math.min(...Object.values(courses).map(({cost}) => cost ?? Infinity));
    this.courses = Object.entries(courses).map(([name, course], n) => {
      const solver = name.split(' ').at(-1), canvas = element('canvas', {
        role: 'img', 'aria-label': `what ${name} did from there on`});
      const title = name.split(' ').map(solverName).join(' ');
      const caption = element('figcaption', {}, element('b', {textContent: title}),
        element('span', {textContent: `cost ${short(course.cost)}`}),
        element('span', {textContent: course.regret === null || course.cost === least
          ? 'the least' : `regret ${short(course.regret)}`}),
        element('span', {textContent: Number.isFinite(course.settled)
          ? 'held to the end' : 'not held at the end'}));
      const figure = element('figure', {className: course.cost === least ? 'best' : ''}, canvas, caption);
      figure.style.setProperty('--chip', solverColour(solver, n));
      return {...course, name, solver, canvas, figure};
    });
    this.duration = Math.max(...this.courses.map(({t}) => t.at(-1) - t[0]));
    find('#courses-list').replaceChildren(...this.courses.map(({figure}) => figure));
    find('#courses').hidden = false;
    this.say({ok: true, text: `${this.courses.length} courses from there on, side by side`});
  }

  close() {
    this.courses = null;
    find('#courses').hidden = true;
  }

  /** Draw the courses at the same time after the branch, over and over. */
  draw(now) {
    if (!this.courses || !this.hello) return;
    const {limits, lengths, cart} = this.hello, reach = lengths.reduce((a, b) => a + b);
    const after = Math.min(now / 1000 % (this.duration + REST), this.duration);
    find('#courses-time').textContent = `+${number(after, 1)} s`;
    for (const {t, X, U, canvas, solver} of this.courses) {
      const {pen, width, height} = fit(canvas), time = t[0] + after;
      const view = new View(width, height, Math.min(limits.track ?? 3, 12) + cart[0], 1.15 * reach);
      const brush = new Brush(pen, view);
      brush.track(limits, cart, false);
      const n = clamp(t.findIndex(each => each > time) - 1, 0, t.length - 1);
      const until = t.at(-1) <= time ? X.length : n + 1;
      brush.line(X.slice(0, until).filter(x => x.every(Number.isFinite)).map(x => tip(x, lengths)),
                 solverColour(solver), 1.5, 0.6);
      const x = at(time, t, X);
      if (!x?.every(Number.isFinite)) continue;
      const places = joints(x, lengths);
      brush.pendulum(places, cart);
      brush.arrow(places[0], U[Math.min(n, U.length - 1)], colours.force, cart[0] / 2);
    }
  }
}
