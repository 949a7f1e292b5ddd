// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The frames of the last seconds, and the time that is shown: about one state behind the newest.

import {at} from './geometry.js';
import {pastOf} from './plots.js';

const KEPT = 1.4;         // times what plots show, of frames
const SLACK = 1.2;        // states behind, so that one that is a little late makes no halt
const LONGEST_GAP = 0.5;  // [s] of stamps between frames that are shown as one motion
const LONGEST_WAIT = 3000; // [ms] between frames of one motion, in slow motion too

export class Stream {
  frames = [];
  times = [];
  states = [];
  shown = 0;         // [s] the time that is shown, by the stamps
  interval = 50;     // [ms] between frames, smoothed
  arrived = 0;       // [ms] when the newest came
  drawn = 0;         // [ms] when `shown` was last moved on

  constructor(scale = {length: 1, time: 1}) {
    this.scale = scale;
  }

  configure({scale}) {
    this.scale = scale;
  }

  get newest() {
    return this.frames.at(-1) ?? null;
  }

  /** Take a frame that came at a time [ms]; what is older than it keeps its figures alone. */
  push(frame, now) {
    const before = this.newest;
    if (before && (frame.t < before.t || frame.t > before.t + LONGEST_GAP * 10)) this.clear();
    const gap = now - this.arrived;
    if (gap < LONGEST_WAIT) this.interval += 0.1 * (gap - this.interval);
    this.arrived = now;
    if (before) [before.planned, before.plan, before.tries] = [before.plan?.U[0], null, null];
    if (before?.t === frame.t) for (const list of this.lists) list.pop();
    this.frames.push(frame);
    this.times.push(frame.t);
    this.states.push(frame.x);
    const first = frame.t - KEPT * pastOf(this.scale);
    while (this.times[0] < first) for (const list of this.lists) list.shift();
    if (this.frames.length === 1) this.shown = frame.t;
  }

  /** Put rows of the past, as `history` has them, before the first frame. */
  precede(rows) {
    const earlier = rows.filter(({t}) => t < (this.times[0] ?? Infinity));
    this.frames.unshift(...earlier);
    this.times.unshift(...earlier.map(({t}) => t));
    this.states.unshift(...earlier.map(({x}) => x));
  }

  get lists() {
    return [this.frames, this.times, this.states];
  }

  clear() {
    for (const list of this.lists) list.length = 0;
  }

  /** Move the shown time on to now [ms], so that it meets the newest state when the next is due. */
  advance(now) {
    const target = this.newest?.t ?? 0, due = this.arrived + SLACK * this.interval;
    const left = due - this.drawn;
    const share = left > 0 ? Math.min((now - this.drawn) / left, 1) : 1;
    if (target - this.shown > LONGEST_GAP) this.shown = target;
    this.shown += Math.max(target - this.shown, 0) * share;
    this.drawn = now;
  }

  /** Return the state at a time [s]. */
  at(time) {
    return at(time, this.times, this.states, this.scale.length);
  }
}
