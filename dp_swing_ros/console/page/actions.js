// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Buttons and keys: equilibria, kicks, reset, enable, pause and pace, recordings, help.

import {element, find, short, words} from './dom.js';

const KICK = 30;       // [N] scaled, for one period
const SVG = 'http://www.w3.org/2000/svg';

/** Draw an equilibrium as a small pendulum: up and down, link 1 first. */
function pictogram(goal) {
  const svg = document.createElementNS(SVG, 'svg');
  svg.setAttribute('viewBox', '0 0 24 34');
  svg.setAttribute('aria-hidden', 'true');
  let [x, z] = [12, 17], way = -1;
  goal.split('_').forEach((word, n, all) => {
    const line = document.createElementNS(SVG, 'line'), long = 15 / all.length * 0.97;
    if (n && word !== all[n - 1]) way = 2 * Math.sign(way);   // folded back, beside the one before
    else way = -Math.sign(way);
    const end = [x + 6 / all.length * way, z + (word === 'up' ? -long : long)];
    const ends = {x1: x, y1: z, x2: end[0], y2: end[1], class: `link${n + 1}`};
    for (const [name, value] of Object.entries(ends)) line.setAttribute(name, value);
    svg.append(line);
    [x, z] = end;
  });
  const cart = document.createElementNS(SVG, 'rect');
  const place = {x: 6, y: 15, width: 12, height: 4, rx: 1};
  for (const [name, value] of Object.entries(place)) cart.setAttribute(name, value);
  svg.append(cart);
  return svg;
}

export class Actions {
  enabled = true;
  paused = false;
  recording = null;
  tries = 40;     // that are shown where nobody has said how many
  told = false;

  constructor(socket, hands, timeline, scene, say) {
    Object.assign(this, {socket, hands, timeline, scene, say});
    const click = (selector, action) => find(selector).addEventListener('click', action);
    click('#kick-left', () => this.kick(-1));
    click('#kick-right', () => this.kick(1));
    click('#reset', () => this.reset());
    click('#enable', () => this.ask({do: 'enable', on: !this.enabled}));
    click('#pause', () => this.pause());
    click('#step', () => this.ask({do: 'step'}));
    click('#record', () => this.record());
    click('#open-help', () => find('#help').showModal());
    find('#pace').addEventListener('change', event =>
      this.ask({do: 'pace', pace: Number(event.target.value)}));
    for (const box of document.querySelectorAll('#shows input')) {
      box.addEventListener('change', () => this.show(box));
    }
    hands.onReference = x => this.ask({do: 'reference', x});
    addEventListener('keydown', event => this.onKey(event));
    addEventListener('keyup', event => {
      if (['ArrowLeft', 'ArrowRight'].includes(event.key)) hands.push(0);
    });
    setInterval(() => this.tellRecording(), 1000);
  }

  async ask(message) {
    const answer = await this.socket.ask(message);
    this.say(answer, '');
    return answer;
  }

  configure(hello) {
    this.hello = hello;
    this.hands.refused = hello.read_only || hello.replay;
    find('#read-only').hidden = !hello.read_only;
    document.documentElement.classList.toggle('replay', hello.replay);
    find('#goals').replaceChildren(...hello.goals.map((goal, n) => {
      const button = element('button', {type: 'button', title: `go to ${words(goal)} (${n + 1})`,
        'aria-pressed': 'false', onclick: () => this.ask({do: 'goal', name: goal})},
        pictogram(goal), element('span', {textContent: words(goal)}));
      button.dataset.goal = goal;
      return button;
    }));
    const {plant, mpc} = hello.nodes, off = this.hands.refused;
    for (const button of document.querySelectorAll('#goals button')) button.disabled = off || !mpc;
    for (const id of ['#kick-left', '#kick-right', '#record']) find(id).disabled = off;
    find('#reset').disabled = off || !(plant || mpc);
    find('#enable').disabled = off || !mpc;
    find('#time').hidden = !hello.pausable;
    for (const id of ['#pause', '#step', '#pace']) find(id).disabled = off;
  }

  onParameters({node, parameters}) {
    const value = name => parameters.find(each => each.name === name)?.value;
    if (node === 'plant' && value('pace') !== undefined) this.showPace(value('pace'));
    if (node !== 'mpc') return;
    this.tries = value('shown_tries') || this.tries;
    if (!this.hands.refused || !this.told) {   // who may not change it looks away for himself
      this.told = true;
      this.scene.shows.samples = find('#shows [value=samples]').checked = value('shown_tries') > 0;
    }
    this.scene.reference = value('reference')?.[0] ?? null;
    const angles = value('reference')?.slice(1, this.hello.links + 1) ?? [];
    const given = angles.map(angle => Math.cos(angle) > 0 ? 'up' : 'down').join('_');
    const goal = value('goal') === 'given' ? given : value('goal');
    for (const button of document.querySelectorAll('#goals button')) {
      button.setAttribute('aria-pressed', String(button.dataset.goal === goal));
    }
  }

  /** Show a pace, also one that others have chosen. */
  showPace(pace) {
    const select = find('#pace');
    select.value = pace;
    if (select.selectedIndex >= 0) return;
    select.append(element('option', {value: pace, textContent: `${short(pace)} ×`}));
    select.value = pace;
  }

  onFrame({tick, paused}) {
    const enabled = tick?.enabled === undefined ? true : Boolean(tick.enabled) && tick.enabled !== 'False';
    if (enabled !== this.enabled) {
      this.enabled = enabled;
      find('#enable').setAttribute('aria-pressed', String(enabled));
      find('#enable').textContent = enabled ? 'Disable' : 'Enable';
    }
    if (paused !== this.paused && !this.hello?.replay) {
      this.paused = paused;
      find('#pause').setAttribute('aria-pressed', String(paused));
      find('#pause').textContent = paused ? 'Go on' : 'Pause';
    }
  }

  kick(way) {
    const usual = KICK * (this.hello?.scale.force ?? 1), most = this.hello?.limits.disturbance ?? usual;
    this.ask({do: 'push', force: way * Math.min(usual, most)});
  }

  async reset() {
    const {plant, mpc} = this.hello.nodes;
    const answer = await this.ask({do: 'reset', node: plant ? 'plant' : 'mpc'});
    if (answer.ok && !plant && mpc) this.say(answer, 'the next tick of the mpc is a first one');
  }

  pause() {
    if (this.hello?.replay) return this.timeline.play(!this.timeline.playing);
    return this.ask({do: 'pause', on: !this.paused});
  }

  /** Show or hide a part of the picture; the mpc tells what it tried only where it is asked to. */
  show(box) {
    this.scene.shows[box.value] = box.checked;
    if (box.value !== 'samples' || this.hands.refused || !this.hello?.nodes.mpc) return;
    this.ask({do: 'set', node: 'mpc', parameters: {shown_tries: box.checked ? this.tries : 0}});
  }

  async record() {
    const on = !this.recording;
    find('#record').disabled = true;
    await this.ask({do: 'record', on});
    find('#record').disabled = this.hands.refused;
  }

  onRecording({folder, since, finished}) {
    this.recording = folder ? {folder, since} : null;   // [s] of the wall clock
    find('#record').setAttribute('aria-pressed', String(Boolean(folder)));
    this.tellRecording();
    find('#recordings').hidden = finished.length === 0;
    find('#recordings ul').replaceChildren(...[...finished].reverse().map(({name, report, bag}) =>
      element('li', {}, element('span', {textContent: name}),
        ...(report ? [element('a', {href: report, textContent: 'report', target: '_blank'})] : []),
        element('a', {href: bag, textContent: 'bag', target: '_blank'}))));
  }

  tellRecording() {
    const label = find('#record span');
    if (!this.recording) { label.textContent = 'Record'; return; }
    const seconds = Date.now() / 1000 - this.recording.since;   // of two clocks, maybe
    label.textContent = `Stop (${Math.max(Math.round(seconds), 0)} s)`;
  }

  onKey(event) {
    const {target, key} = event;
    const typing = target.matches?.('select, textarea, input:not([type=range], [type=checkbox])');
    if (find('#help').open || event.ctrlKey || event.metaKey || event.altKey) return;
    if (typing) { if (key === 'Escape') target.blur(); return; }
    if (key === ' ' && target.matches?.('button, summary, [type=checkbox], a')) return;
    const way = {ArrowLeft: -1, ArrowRight: 1}[key];
    if (way) {
      if (target.matches?.('[type=range]:not(#instant), [role=tab]')) return;
      event.preventDefault();
      if (this.timeline.history || this.hello?.replay) this.timeline.step(way);
      else this.hands.push(way);
      return;
    }
    if (event.repeat) return event.preventDefault();   // held, it would be one command after the other
    const action = {
      '?': () => find('#help').showModal(), '/': () => find('#search-tab').click(),
      k: () => find('#kick-right').click(), j: () => find('#kick-left').click(),
      r: () => find('#reset').click(), e: () => find('#enable').click(),
      ' ': () => this.pause(), '.': () => find('#step').click(),
      t: () => this.timeline.toggle(), b: () => find('#branch').click(),
      c: () => find('#record').click()}[key] ?? this.goalKey(key);
    if (!action) return;
    event.preventDefault();
    action();
  }

  goalKey(key) {
    const button = document.querySelectorAll('#goals button')[Number(key) - 1];
    return button && (() => button.click());
  }
}
