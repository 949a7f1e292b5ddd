// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Brings the parts of the page together: what comes from the console, and what is drawn when.

import {Actions} from './actions.js';
import {Controls} from './controls.js';
import {decimals, element, find, measure, number, short, solverName, words} from './dom.js';
import {wrapped} from './geometry.js';
import {Hands} from './hands.js';
import {pastOf} from './plots.js';
import {Scene} from './scene.js';
import {Socket} from './socket.js';
import {Stream} from './stream.js';
import {Thoughts} from './thoughts.js';
import {Timeline} from './timeline.js';

const PLACED = 100;       // [ms] between tellings of where the joints are [px], for who drives the page
const DESCRIBED = 2000;   // [ms] between descriptions of the picture in words

const url = new URL('socket', location.href);
url.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
const socket = new Socket(url.href);
const stream = new Stream();
const canvas = find('#picture');
const scene = new Scene(canvas);
const controls = new Controls(socket);
const say = (answer, done) => controls.say(answer, done);
const timeline = new Timeline(socket, stream, say);
const hands = new Hands(scene, socket);
const thoughts = new Thoughts();
const actions = new Actions(socket, hands, timeline, scene, say);
const parameters = new Map();   // the last of each node
let hello = null, placed = 0, described = 0, fresh = null, written = null, silent = {};
let stale = false;   // are the numbers, without a fresh frame

socket.on('open', () => {
  document.documentElement.classList.remove('lost');
  find('#lost').hidden = true;
});
socket.on('closed', ({reason, wait}) => {
  document.documentElement.classList.add('lost');
  hands.letGo();
  find('#lost').hidden = false;
  find('#lost span').textContent = `The console does not answer${reason ? `: ${reason}` : ''}. ` +
    `Trying again in ${number(wait / 1000, 1)} s.`;
});
find('#lost button').addEventListener('click', () => socket.connect());

socket.on('hello', message => {
  const laidOut = JSON.stringify([message.links, message.limits, message.goals, message.lengths,
    message.units, pastOf(message.scale)]);
  const changed = laidOut !== hello?.laidOut;
  hello = {...message, laidOut};
  for (const part of [stream, scene, controls, timeline, actions]) part.configure(hello);
  thoughts.configure(hello, changed);
  for (const last of parameters.values()) onParameters(last);
  const {plant, mpc} = hello.nodes;
  find('#nodes').textContent = hello.replay ? 'a bag' : [plant, mpc].filter(Boolean).join(' · ') ||
    'waiting for a plant or an mpc';
});
socket.on('parameters', message => {
  parameters.set(message.node, message);
  if (hello) onParameters(message);   // else it waits until one knows what may be changed
});
function onParameters(message) {
  for (const part of [controls, thoughts, actions]) part.onParameters(message);
}
socket.on('frame', frame => {
  stream.push(frame, performance.now());
  fresh = frame;
  for (const part of [timeline, actions]) part.onFrame(frame);
});
socket.on('silence', message => {
  [silent, stale] = [message.silent, true];
  const names = Object.keys(silent), before = [...find('#silence').querySelectorAll('span')];
  for (const role of ['plant', 'mpc']) {
    document.documentElement.classList.toggle(`${role}-silent`, names.includes(role));
  }
  find('#silence').hidden = names.length === 0;
  if (names.length && names.join() === before.map(span => span.dataset.role).join()) {
    for (const span of before) span.textContent = ` for ${silent[span.dataset.role]} s`;
    return;   // who listens hears it once, not each second
  }
  find('#silence').replaceChildren(...names.flatMap((role, n) => [
    n ? ', ' : '', `${role} has been silent`,
    lasting(role)]));
});
function lasting(role) {
  const span = element('span', {ariaHidden: 'true', textContent: ` for ${silent[role]} s`});
  span.dataset.role = role;
  return span;
}
socket.on('status', message => thoughts.onStatus(message));
socket.on('recording', message => actions.onRecording(message));

function write(frame) {
  const {tick} = frame, {units} = hello, digits = decimals(1, hello.scale.force);
  const values = {
    '#now-time': `${number(frame.time, 1)} s`,
    '#now-applied': measure(frame.u, digits, units.force),
    '#now-command': measure(frame.force, digits, units.command),
    '#now-push': `${number(frame.push ?? 0, Math.max(digits - 1, 0))} ${units.force}`,
    '#now-cost': short(tick?.cost), '#now-solve': measure(1000 * tick?.solve_time, 1, 'ms'),
    '#now-solver': solver(tick)};
  for (const [selector, text] of Object.entries(values)) find(selector).textContent = text;
  find('#now-status').textContent = timeline.past ? words(String(tick?.status ?? '–').toLowerCase())
    : frame.paused ? 'paused' : 'plant' in silent ? 'plant is silent' : 'mpc' in silent ? 'mpc is silent'
      : words(String(tick?.status ?? '–').toLowerCase());
}

/** Return the solver of a tick, or the one that is on its way to be it. */
function solver(tick) {
  const wanted = thoughts.parameters.mpc?.solver?.value;
  if (!timeline.past && !hello.replay && tick?.solver && wanted && wanted !== tick.solver) return `${solverName(wanted)} loading …`;
  return tick?.solver ? solverName(tick.solver) : '–';
}

function describe({x, tick}) {
  const lean = x.slice(1, hello.links + 1).map((angle, n) =>
    `link ${n + 1} ${number(Math.abs(wrapped(angle)) * 180 / Math.PI, 0)}° from upright`);
  canvas.setAttribute('aria-label', `The pendulum: cart at ` +
    `${number(x[0], decimals(2, hello.scale.length))} m, ${lean.join(', ')}. ` +
    (tick?.solver ? `${solverName(tick.solver)}, cost ${short(tick.cost)}.` : ''));
}

/** Draw; a browser calls this only while the page is seen. */
function draw(now) {
  requestAnimationFrame(draw);
  stream.advance(now);
  hands.frozen = timeline.history !== null || hello?.replay;
  hands.renew(now);
  const shown = timeline.past ?? stream, frame = shown.newest;
  scene.draw(now, shown);
  if (fresh) hands.seen(fresh);
  timeline.draw(now);
  thoughts.draw(now, shown);
  if (!hello || !frame) return;
  // with the picture, whose arrows have the same numbers
  if (frame !== written || stale) write(frame);
  [fresh, stale, written] = [null, false, frame];
  if (now - placed > PLACED) {
    placed = now;
    canvas.dataset.places = JSON.stringify(scene.places?.map(place => scene.view.toScreen(place)) ?? []);
  }
  if (now - described > DESCRIBED) { described = now; describe(frame); }
}

const tabs = [...document.querySelectorAll('[role=tab]')];
function select(tab) {
  for (const each of tabs) {
    each.setAttribute('aria-selected', String(each === tab));
    each.tabIndex = each === tab ? 0 : -1;
    find(`#${each.getAttribute('aria-controls')}`).hidden = each !== tab;
  }
}
for (const tab of tabs) {
  tab.addEventListener('click', () => select(tab));
  tab.addEventListener('keydown', event => {
    if (!['ArrowLeft', 'ArrowRight'].includes(event.key)) return;
    const there = tabs.filter(each => !each.hidden), way = event.key === 'ArrowLeft' ? -1 : 1;
    const other = there.at((there.indexOf(tab) + way) % there.length);
    select(other);
    other.focus();
  });
}
find('#search-tab').addEventListener('click', () => find('#search').focus({preventScroll: true}));
addEventListener('resize', () => timeline.drawStrip());

socket.connect();
requestAnimationFrame(draw);
