// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// A scrolling plot of the last seconds, with what is planned beyond now: lines, steps or a stack.

import {colours} from './colours.js';
import {fit} from './draw.js';
import {element, rounded, ticked} from './dom.js';

const PAST = 10;                 // [s] scaled, that are seen
const AHEAD = 0.15;              // of these beyond now
const LEFT = 44, RIGHT = 6, TOP = 6, BOTTOM = 16;  // [px] of the frame
const EASE = 0.4;                // share of the way that the scale goes to the new one at a drawing

/** Return how many seconds of the past are seen of a pendulum of a scale. */
export const pastOf = ({time}) => rounded(PAST * time);

/** Return a round number that is not less. */
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 2.5, 5, 10].find(step => step * power >= value * 0.999) * power;
}

export class Plot {
  /**
   * series: [{name, colour, of: frame => value, ahead: plan => values, step}]; a step holds a value
   * `on` from its frame, or `until` it. levels: [{of, dash}] are horizontal lines; a stack fills
   * one series on the other, from zero up. The last `past` seconds are seen.
   */
  constructor({title, unit, past, series, levels = [], range = null, least = 1, stack = false,
               signed = false, ticks = null}) {
    Object.assign(this, {title, unit, past, series, levels, range, least, stack, signed, ticks});
    this.canvas = element('canvas', {role: 'img', 'aria-label': `${title}, last ${past} s`});
    this.value = element('span', {className: 'value'});   // no output: 20 a second are no news
    this.legend = element('span', {className: 'legend'});
    this.figure = element('figure', {className: 'plot'},
      element('figcaption', {}, element('b', {textContent: title}),
              element('small', {textContent: unit}), this.legend, this.value), this.canvas);
    this.top = least;
    this.drawn = 0;   // [ms] when
    this.visible = true;
    new IntersectionObserver(([entry]) => { this.visible = entry.isIntersecting; })
      .observe(this.figure);
  }

  /** Name the series in the caption. */
  name() {
    const shown = this.series.map(({name, colour}) => name + colour()).join();
    if (shown === this.named) return;
    this.named = shown;
    this.legend.replaceChildren(...this.series.filter(({name}) => name).map(({name, colour}) => {
      const chip = element('span', {textContent: name});
      chip.style.setProperty('--chip', colour());
      return chip;
    }));
  }

  /** Draw frames up to a time [s] that is now, and a plan; at a time [ms] of the page. */
  draw(at, frames, now, plan) {
    this.drawn = at;
    if (!this.visible) return;
    this.name();
    const {pen, width, height} = fit(this.canvas);
    const {past} = this, span = past * (1 + AHEAD), right = width - RIGHT, bottom = height - BOTTOM;
    const left = t => LEFT + (t - now + past) / span * (right - LEFT);
    const recent = frames.filter(({t}) => t >= now - 1.03 * past && t <= now + 1e-6);
    const next = frames[frames.indexOf(recent.at(-1)) + 1];
    const [low, high] = this.range ? this.range() : this.scaled(recent);
    const up = value => bottom - (value - low) / (high - low) * (bottom - TOP);
    this.frame(pen, {left, up, low, high, right, bottom, now});
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP - 2, right - LEFT, bottom - TOP + 4);
    pen.clip();
    if (this.stack) this.fill(pen, recent, left, up); else this.lines(pen, recent, left, up, {...next, t: now});
    if (plan) this.future(pen, plan, left, up);
    pen.restore();
  }

  /** Return the scale that holds all values, which comes after a while. */
  scaled(frames) {
    let most = this.least;
    for (const frame of frames) {
      const values = this.series.map(({of}) => of(frame) || 0);
      most = Math.max(most, this.stack ? values.reduce((a, b) => a + Math.max(b, 0), 0)
                                       : Math.max(...values.map(Math.abs)));
    }
    const wanted = this.wanted = roundUp(1.05 * most);
    this.top += (wanted - this.top) * (wanted > this.top ? 1 : EASE);
    if (Math.abs(this.top / wanted - 1) < 0.02) this.top = wanted;
    const signed = this.signed ||= !this.stack && frames.some(
      frame => this.series.some(({of}) => of(frame) < 0));
    return [signed ? -this.top : 0, this.top];
  }

  frame(pen, {left, up, low, high, right, bottom, now}) {
    const {wanted = high} = this, ticks = this.ticks ?? ticked(low < 0 ? [-wanted, 0, wanted] : [0, wanted / 2, wanted]);
    pen.font = '11px system-ui, sans-serif';
    [pen.textBaseline, pen.textAlign, pen.lineWidth] = ['middle', 'right', 1];
    for (const [value, text] of ticks) {
      pen.strokeStyle = colours.line;
      pen.beginPath();
      pen.moveTo(LEFT, up(value));
      pen.lineTo(right, up(value));
      pen.stroke();
      pen.fillStyle = colours.faint;
      pen.fillText(text, LEFT - 6, up(value));
    }
    [pen.textBaseline, pen.textAlign] = ['top', 'center'];
    for (const back of [this.past, this.past / 2, 0]) {
      pen.fillText(back ? `−${back} s` : 'now', Math.max(left(now - back), LEFT + 10), bottom + 4);
    }
    for (const {of, dash = [5, 4], colour = () => colours.faint} of this.levels) {
      const value = of();
      if (!(value >= low && value <= high)) continue;
      pen.strokeStyle = colour();
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(LEFT, up(value));
      pen.lineTo(right, up(value));
      pen.stroke();
      pen.setLineDash([]);
    }
    pen.fillStyle = colours.soft;
    pen.fillRect(left(now), TOP, right - left(now), bottom - TOP);
  }

  /** Draw the series; next is the frame on the way to which it is now. */
  lines(pen, frames, left, up, next) {
    for (const {of, colour, step, wraps} of this.series) {
      pen.beginPath();
      let before = null;
      for (const frame of step === 'until' && next.x ? [...frames, next] : frames) {
        const value = of(frame);
        if (!Number.isFinite(value)) { before = null; continue; }
        const [x, y] = [left(frame.t), up(value)];
        if (before === null || wraps && Math.abs(value - before.value) > wraps) pen.moveTo(x, y);
        else if (step === 'on') pen.lineTo(x, up(before.value));
        else if (step === 'until') pen.lineTo(before.x, y);
        pen.lineTo(x, y);
        before = {value, x};
      }
      [pen.strokeStyle, pen.lineWidth, pen.lineJoin] = [colour(), 1.6, 'round'];
      pen.stroke();
    }
  }

  future(pen, plan, left, up) {
    for (const {ahead, colour, step, wraps} of this.series) {
      if (!ahead) continue;
      pen.beginPath();
      let before = null;
      ahead(plan).forEach((value, n) => {
        const [x, y] = [left(plan.t + n * plan.dt), up(value)];
        if (before === null || wraps && Math.abs(value - before) > wraps) pen.moveTo(x, y);
        else if (step) { pen.lineTo(x, up(before)); pen.lineTo(x, y); }
        else pen.lineTo(x, y);
        before = value;
      });
      [pen.strokeStyle, pen.lineWidth] = [colour(), 1.6];
      pen.setLineDash([2, 3]);
      pen.stroke();
      pen.setLineDash([]);
    }
  }

  /** Fill the series on each other. */
  fill(pen, frames, left, up) {
    const sums = frames.map(() => 0);
    for (const {of, colour, over} of this.series) {
      if (over) continue;
      const lower = [...sums];
      frames.forEach((frame, n) => { sums[n] += Math.max(of(frame) || 0, 0); });
      pen.beginPath();
      frames.forEach((frame, n) => pen[n ? 'lineTo' : 'moveTo'](left(frame.t), up(sums[n])));
      for (let n = frames.length - 1; n >= 0; n--) pen.lineTo(left(frames[n].t), up(lower[n]));
      pen.fillStyle = colour();
      pen.fill();
    }
    const over = this.series.filter(each => each.over);
    if (over.length) this.lines.call({series: over}, pen, frames, left, up);
  }
}
