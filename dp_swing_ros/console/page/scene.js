// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The picture: the pendulum between its last states, what pulls at it, and what the mpc plans.

import {colours, linkColour} from './colours.js';
import {BELOW_TRACK, Brush, fit, View} from './draw.js';
import {ahead, joints, linksOf, placeOn, tip} from './geometry.js';
import {decimals, number} from './dom.js';

// all but RUN, which is for eyes, of the default bodies, and scaled for others
const TRACE = 1.2, TRACE_STEP = 0.02;  // [s]
const TRACE_JUMP = 0.6;   // [m] that no tip moves in a step
const GHOSTS = 4;         // poses of the plan that are drawn
const DIFFERENT = 0.02;   // [m] from where on an estimate is drawn beside the measurement
const RUN = 1.6;          // [s] in which the ghost runs to the end of the plan

export class Scene {
  shows = {plan: true, samples: true, trace: true, estimate: true};
  reference = null;       // [m] the cart's
  held = null;            // {body, along, to} while the user pulls
  aimed = null;           // [m] where a click would move the reference

  constructor(canvas) {
    this.canvas = canvas;
  }

  configure(hello) {
    this.hello = hello;
  }

  /** Draw the state that a stream shows, live or of the past; now [ms] moves the ghost. */
  draw(now, stream) {
    this.stream = stream;
    const {pen, width, height} = fit(this.canvas);
    if (!this.hello || width === 0) return;
    const {limits, lengths, cart, scale} = this.hello, reach = lengths.reduce((a, b) => a + b);
    const side = Math.min(limits.track ?? 3 * scale.length, 12 * scale.length);
    this.view = new View(width, height, side + cart[0] + 0.25 * scale.length, 1.14 * reach);
    const brush = new Brush(pen, this.view, scale);
    brush.track(limits, cart, true, this.reference);
    this.drawReference(brush);
    const frame = this.stream.newest;
    const x = stream.at(stream.shown);
    if (!x?.every(Number.isFinite)) return;
    const places = joints(x, lengths);
    this.places = places;
    if (this.shows.trace) this.drawTrace(brush);
    this.drawThoughts(brush, frame, now);
    brush.pendulum(places, cart, this.hello.centres);
    this.drawEstimate(brush, frame, x);
    this.drawForces(brush, frame, places);
  }

  drawReference(brush) {
    const {length} = this.hello.scale;
    const mark = (x, alpha) => {
      const z = length * (BELOW_TRACK - 0.02), [half, low] = [0.07 * length, z - 0.13 * length];
      brush.path([[x, z], [x - half, low], [x + half, low]]);
      brush.pen.globalAlpha = alpha;
      brush.pen.fillStyle = colours.accent;
      brush.pen.fill();
      brush.pen.globalAlpha = 1;
    };
    if (this.reference !== null) mark(this.reference, 1);
    if (this.aimed === null) return;
    mark(this.aimed, 0.5);
    brush.text(`${number(this.aimed, decimals(2, length))} m`,
               [this.aimed, length * (BELOW_TRACK - 0.3)], colours.accent, [0, 4]);
  }

  drawTrace(brush) {
    const {lengths, scale} = this.hello, end = this.stream.shown, trace = TRACE * scale.time;
    const first = Math.max(end - trace, this.stream.times[0] ?? end), most = TRACE_JUMP * scale.length;
    let before = null;
    for (let t = first; t <= end; t += TRACE_STEP * scale.time) {
      const x = this.stream.at(t), place = x?.every(Number.isFinite) ? tip(x, lengths) : null;
      if (before && place && Math.hypot(place[0] - before[0], place[1] - before[1]) < most) {
        const alpha = 0.75 * (1 - (end - t) / trace) ** 1.5;
        brush.line([before, place], linkColour(linksOf(x) - 1), 3, alpha, [], 'butt');
      }
      before = place;
    }
  }

  /** Draw what the mpc plans, as a ghost that runs ahead, and what it tried. */
  drawThoughts(brush, frame, now) {
    const {lengths, scale} = this.hello, {plan, tries} = frame;
    if (tries && this.shows.samples) this.drawTries(brush, tries);
    if (!plan || !this.shows.plan || plan.X.length < 2) return;
    const end = (plan.X.length - 1) * plan.dt;
    brush.line(plan.X.map(x => tip(x, lengths)), linkColour(lengths.length - 1), 1.5, 0.75, [2, 5]);
    for (let n = GHOSTS; n > 0; n--) {
      brush.outline(joints(ahead(plan, n / GHOSTS * end, scale.length), lengths), this.hello.cart,
                    0.3 - 0.05 * n, []);
    }
    const run = now / 1000 / RUN % 1;
    brush.outline(joints(ahead(plan, run * end, scale.length), lengths), this.hello.cart,
                  0.75 * (1 - run), []);
  }

  /** Draw the fan of tips that were tried: the heavier, the stronger and the later. */
  drawTries(brush, {paths, weights}) {
    const most = Math.max(...weights, 1e-12);
    const order = weights.map((weight, n) => [weight / most, n]).sort((a, b) => a[0] - b[0]);
    for (const [share, n] of order) {
      brush.line(paths[n], share > 0.5 ? colours.c5 : colours.c6, 1 + share, 0.3 + 0.5 * share);
    }
  }

  drawEstimate(brush, {estimate}, x) {
    if (!estimate?.every(Number.isFinite) || !this.shows.estimate) return;
    const {lengths, cart, scale} = this.hello, measured = this.stream.newest.x;
    if (!measured.every(Number.isFinite) || measured.length !== estimate.length) return;
    // the estimate is of the newest state: draw its difference at the one that is shown
    const shown = x.map((value, i) => value + estimate[i] - measured[i]);
    const [places, others] = [joints(x, lengths), joints(shown, lengths)];
    const off = Math.max(...places.map(([a, b], n) => Math.hypot(a - others[n][0], b - others[n][1])));
    const different = DIFFERENT * scale.length;
    const cartIsOff = Math.abs(places[0][0] - others[0][0]) > different / 2;
    if (off > different) brush.outline(others, cartIsOff ? cart : null, 0.9, [5, 4]);
  }

  /** Draw the force that is applied, the push beside it, and the rubber line of the user's pull. */
  drawForces(brush, {u, push}, places) {
    const {cart: [width, height], scale: {length, force: unit}, units} = this.hello;
    const text = force => `${number(force, decimals(1, unit))} ${units.force}`;
    brush.arrow(places[0], u, colours.force, width / 2, text(u));
    const above = [places[0][0], height / 2 + 0.1 * length];
    if (!this.held) {
      if (push) brush.arrow(above, push, colours.push, 0, text(push));
      return;
    }
    const place = placeOn(places, this.held);
    brush.line([place, this.held.to], colours.push, 2.5, 0.9, [6, 5]);
    brush.dot(place, 5, colours.push);
    brush.dot(this.held.to, 8, 'transparent', colours.push);
    if (push) brush.arrow(place, push, colours.push, 0.02 * length, text(push));
    else brush.text('0 N', this.held.to, colours.push, [0, -20]);
  }
}
