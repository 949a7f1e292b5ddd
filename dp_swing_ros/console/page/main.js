// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Brings the parts of the page together: what comes from the console, and what is drawn when.

import {Actions} from './actions.js';
import {Controls} from './controls.js';
import {find, number, short, solverName, words} from './dom.js';
import {wrapped} from './geometry.js';
import {Hands} from './hands.js';
import {Scene} from './scene.js';
import {Socket} from './socket.js';
import {Stream} from './stream.js';
import {Thoughts} from './thoughts.js';
import {Timeline} from './timeline.js';

const WRITTEN = 100;      // [ms] between the numbers beside the picture
const DESCRIBED = 2000;   // [ms] between descriptions of the picture in words
const SILENT = 2000;      // [ms] without a state until the page says so

const url = new URL('socket', location.href);
url.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
const socket = new Socket(url.href);
const stream = new Stream();
const canvas = find('#picture');
const scene = new Scene(canvas, stream);
const controls = new Controls(socket);
const say = (answer, done) => controls.say(answer, done);
const timeline = new Timeline(socket, stream, say);
const hands = new Hands(scene, socket);
const thoughts = new Thoughts(stream);
const actions = new Actions(socket, hands, timeline, scene, say);
const parameters = new Map();   // the last of each node
let hello = null, written = 0, described = 0, fresh = null;

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
  const laidOut = JSON.stringify([message.links, message.limits, message.goals, message.lengths]);
  const changed = laidOut !== hello?.laidOut;
  hello = {...message, laidOut};
  for (const part of [scene, controls, timeline, actions]) part.configure(hello);
  if (changed) thoughts.configure(hello);
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
  for (const part of [thoughts, timeline, actions]) part.onFrame(frame);
});
socket.on('status', message => thoughts.onStatus(message));
socket.on('recording', message => actions.onRecording(message));

function write(frame, given) {
  const {tick} = given ? {} : frame, first = stream.start ??= frame.t;
  const values = {
    '#now-time': `${number((given ?? frame).t - (hello.replay ? 0 : first), 1)} s`,
    '#now-force': `${number(given ? given.u : frame.force ?? frame.u, 1)} N`,
    '#now-push': `${number((given ?? frame).push ?? 0, 0)} N`,
    '#now-cost': short(tick?.cost), '#now-solve': tick ? `${number(1000 * tick.solve_time, 1)} ms` : '–',
    '#now-solver': tick?.solver ? solverName(tick.solver) : '–'};
  for (const [selector, text] of Object.entries(values)) find(selector).textContent = text;
  find('#now-status').textContent = given ? 'looking back' : frame.paused ? 'paused'
    : silent() ? 'no state comes' : words(String(tick?.status ?? '').toLowerCase());
  // where the joints are drawn on the page [px], for who drives it from outside
  canvas.dataset.places = JSON.stringify(scene.places?.map(place => scene.view.toScreen(place)) ?? []);
}

const silent = () => performance.now() - stream.arrived > SILENT;

function describe({x, tick}) {
  const lean = x.slice(1, hello.links + 1).map((angle, n) =>
    `link ${n + 1} ${number(Math.abs(wrapped(angle)) * 180 / Math.PI, 0)}° from upright`);
  canvas.setAttribute('aria-label', `The pendulum: cart at ${number(x[0])} m, ${lean.join(', ')}. ` +
    (tick?.solver ? `${solverName(tick.solver)}, cost ${short(tick.cost)}.` : ''));
}

/** Draw; a browser calls this only while the page is seen. */
function draw(now) {
  requestAnimationFrame(draw);
  stream.advance(now);
  hands.frozen = timeline.history !== null || hello?.replay;
  hands.renew(now);
  const given = timeline.given();
  scene.draw(now, given);
  if (fresh) hands.seen(fresh);
  fresh = null;
  timeline.draw(now);
  if (timeline.history === null) thoughts.draw(now);
  const frame = stream.newest;
  if (!hello || !frame) return;
  if (now - written > WRITTEN) { written = now; write(frame, given); }
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
for (const [n, tab] of tabs.entries()) {
  tab.addEventListener('click', () => select(tab));
  tab.addEventListener('keydown', event => {
    if (!['ArrowLeft', 'ArrowRight'].includes(event.key)) return;
    const other = tabs[(n + 1) % tabs.length];
    select(other);
    other.focus();
  });
}
find('#search-tab').addEventListener('click', () => find('#search').focus({preventScroll: true}));
addEventListener('resize', () => timeline.drawStrip());

socket.connect();
requestAnimationFrame(draw);
