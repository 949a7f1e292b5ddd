// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// What the mpc thinks: plots of its ticks, the pendulum that it has learned, diagnostics in words.

import {colours, linkColour} from './colours.js';
import {decimals, element, find, measure, number, short, words} from './dom.js';
import {wrapped} from './geometry.js';
import {pastOf, Plot} from './plots.js';

const TERMS = ['angles', 'position', 'velocities', 'force', 'limits', 'terminal'];
const PHASES = ['estimate', 'starts', 'rollout', 'derivatives', 'backward', 'line_search', 'noise',
  'rollouts', 'update'];
const SHADES = ['c1', 'c2', 'c3', 'c5', 'c6', 'c4', 'c7'];
const LEVELS = ['ok', 'warning', 'error', 'stale'], SIGNS = ['✓', '!', '✕', '…'];
const BUSY = 0.8;      // of the period, what a solve has at most
const DRAWN = 90;      // [ms] at least between drawings of a plot
const WRITTEN = 250;   // [ms] between the rows of what is learned
const TICKS = [[-Math.PI, '−π'], [0, '0'], [Math.PI, 'π']];

/** Return a number with three digits after the point, a small one with the power of ten that it needs. */
const figure = value => value && Math.abs(value) < 0.01 ? short(value) : number(value, 3);
const millis = name => ({tick}) => Number.isFinite(tick?.[name]) ? 1000 * tick[name] : null;

export class Thoughts {
  written = 0;
  phases = '';
  parameters = {};       // of each node, by name

  constructor() {
    this.place = find('#plots');
  }

  /** Take what there is; lay the plots out anew where that has changed. */
  configure(hello, changed) {
    this.hello = hello;
    if (!changed) return;
    const {links, limits, scale, units} = hello, line = c => () => colours[c], past = pastOf(scale);
    const angles = Array.from({length: links}, (_, n) => ({
      name: `θ${'₁₂₃'[n]}`, colour: () => linkColour(n), wraps: Math.PI,
      of: ({x}) => wrapped(x[n + 1] ?? NaN), ahead: plan => plan.X.map(x => wrapped(x[n + 1]))}));
    const both = value => [{of: () => value}, {of: () => -value}];
    const track = limits.track ?? null, force = limits.force ?? 20 * scale.force;
    const bounded = track && track < 20 * scale.length;
    this.force = new Plot({
      past, title: units.force === 'N' ? 'Force' : 'Acceleration', unit: units.force, least: force,
      signed: true, levels: limits.force ? both(force) : [],
      // volts and velocities are of another axis
      series: [{name: units.command === units.force ? 'commanded' : 'planned', colour: line('c5'), step: 'on',
                of: frame => units.command === units.force ? frame.force
                  : frame.planned ?? frame.plan?.U[0],
                ahead: plan => plan.U},
               {name: 'applied', colour: line('force'), step: 'until', of: frame => frame.u},
               {name: 'push', colour: line('push'), step: 'on', of: frame => frame.push || 0}]});
    this.angles = new Plot({
      past, title: 'Angles', unit: 'rad, 0 is upright', series: angles, ticks: TICKS,
      range: () => [-3.3, 3.3]});
    this.position = new Plot({
      past, title: 'Position', unit: 'm', least: scale.length, signed: true,
      range: bounded ? () => [-1.08 * track, 1.08 * track] : null,
      ticks: bounded ? [-track, 0, track].map(x => [x, number(x, decimals(1, scale.length))]) : null,
      levels: track ? both(track - limits.margin) : [],
      series: [{name: 'x', colour: line('ink'), of: ({x}) => x[0], ahead: plan => plan.X.map(x => x[0])}]});
    this.cost = new Plot({
      past, title: 'Cost of the plan', unit: 'by term', stack: true, least: 0.1,
      series: TERMS.map((term, n) => ({
        name: term, colour: () => colours[SHADES[n]], of: ({tick}) => tick?.[`cost_${term}`]}))});
    this.time = new Plot({
      past, title: 'Solve time', unit: 'ms, deadline dashed', stack: true, least: 4,
      levels: [{of: () => 1000 * Math.min(this.parameters.mpc?.time_limit?.value ?? Infinity,
                                          BUSY * this.hello.period),
                colour: line('alarm')}], series: []});
    this.iterations = new Plot({
      past, title: 'Iterations', unit: 'a tick', least: 5,
      series: [{name: '', colour: line('c1'), step: 'on', of: ({tick}) => tick?.iterations}]});
    this.plots = [this.angles, this.position, this.force, this.cost, this.time, this.iterations];
    this.force.figure.classList.add('force');
    this.place.replaceChildren(...this.plots.map(plot => plot.figure));
    for (const plot of this.plots.slice(3)) plot.figure.classList.add('of-mpc');
    this.phases = '';
  }

  onParameters({node, parameters}) {
    this.parameters[node] = Object.fromEntries(parameters.map(each => [each.name, each]));
  }

  /** Let the plots follow what this solver spends its time on. */
  follow({tick}) {
    const present = PHASES.filter(phase => tick && `${phase}_time` in tick);
    if (present.join() !== this.phases) {
      this.phases = present.join();
      this.time.series = [
        ...present.map((phase, n) => ({name: words(phase), colour: () => colours[SHADES[n % 7]],
                                       of: millis(`${phase}_time`)})),
        {name: 'latency', colour: () => colours.ink, over: true, of: millis('latency')}];
    }
  }

  /** Draw a plot of a stream, live or of the past, and write the numbers of its newest frame. */
  draw(now, stream) {
    const frame = stream.newest;
    if (!this.hello || !frame || find('#thoughts').hidden) return;
    if (stream !== this.stream) {   // of another time, whose scale comes at once
      for (const plot of this.plots) [plot.top, plot.drawn] = [plot.least, 0];
    }
    this.stream = stream;
    const fresh = frame !== this.frame;
    if (fresh) this.follow(frame);
    this.frame = frame;
    // one at a time, which waits longest: an mpc may need the core
    const plot = this.plots.reduce((first, other) => other.drawn < first.drawn ? other : first);
    if (now - plot.drawn >= DRAWN) {
      plot.draw(now, stream.frames, stream.shown, frame.plan);
    }
    if (fresh) this.write(frame);
    if (now - this.written < WRITTEN) return;
    this.written = now;
    this.writeLearned(frame.tick);
  }

  write({x, u, tick}) {
    const {links, scale} = this.hello;
    this.angles.value.textContent = x.slice(1, links + 1).map(a => number(wrapped(a ?? NaN))).join(', ');
    this.position.value.textContent = measure(x[0], decimals(2, scale.length), 'm');
    this.force.value.textContent = `applied ${measure(u, decimals(1, scale.force), this.hello.units.force)}`;
    this.cost.value.textContent = short(tick?.cost);
    this.time.value.textContent = `${measure(1000 * tick?.solve_time, 1, 'ms')}, ` +
      `latency ${measure(1000 * tick?.latency, 1, 'ms')}`;
    this.iterations.value.textContent = tick?.iterations ?? '–';
  }

  /** Set what the estimator has learned beside what the plant has, where both are known. */
  writeLearned(tick) {
    const {mpc, plant} = this.parameters;
    const names = this.hello.estimated.filter(name => mpc?.[name] && typeof tick?.[name] === 'number');
    const section = find('#learned');
    section.hidden = names.length === 0;
    const rows = names.map(name => {
      const told = tick[name], truth = plant?.[name]?.value;
      const off = typeof truth === 'number' ? told - truth : NaN;
      const share = truth ? `${number(100 * off / truth, 1)} %` : '';
      return element('tr', {},
        element('th', {scope: 'row', textContent: words(name)}),
        element('td', {textContent: figure(told)}),
        element('td', {textContent: figure(truth)}),
        element('td', {textContent: Number.isFinite(off) ? share || figure(off) : '–'}),
        element('td', {className: 'unit', textContent: mpc[name].unit ?? ''}));
    });
    section.querySelector('tbody').replaceChildren(...rows);
  }

  onStatus({statuses}) {
    find('#statuses').replaceChildren(...statuses.map(({name, level, message}) => element(
      'li', {className: LEVELS[level] ?? 'stale'},
      element('span', {className: 'sign', textContent: SIGNS[level] ?? '…',
                       title: LEVELS[level] ?? ''}),
      element('b', {textContent: name}), element('span', {textContent: message}))));
  }
}
