// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Sliders, switches and choices for every parameter that the nodes declare, and their presets.

import {clamp, element, find, rounded, short, solverName, symbols, words} from './dom.js';
import {scaleOf} from './scale.js';

const SAID = 8000;     // [ms] that a notice stays
const SOONEST = 150;   // [ms] between two changes while a slider moves
// what is looked for most, first; all else goes by its prefix
const AT_HAND = {
  mpc: ['solver', 'horizon', 'state_weights', 'force_weight', 'shown_tries'],
  plant: ['link1_mass', 'link2_mass', 'cart_mass', 'pace']};
const FIRST = 'At hand', REST = 'others';

/** Return the name of the group that a parameter belongs to, given all names. */
function groupOf(name, node, solver, names) {
  if (AT_HAND[node]?.includes(name)) return FIRST;
  if (name.includes('.')) return name.split('.')[0];
  const prefix = name.split('_')[0].replace(/\d+$/, '');
  return names.filter(other => other.split('_')[0].replace(/\d+$/, '') === prefix).length > 1
    ? prefix : REST;
}

const shown = value => typeof value === 'number' ? short(value)
  : Array.isArray(value) ? `[${value.map(shown).join(', ')}]` : String(value);
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** One parameter: its name and description, what sets it, and what the node said to that. */
class Control {
  constructor(node, parameter, panel) {
    Object.assign(this, {node, parameter, panel});
    const {name, unit, description, type} = parameter, id = `${node}-${name}`;
    this.error = element('p', {className: 'refusal', role: 'alert', hidden: true});
    this.usual = element('button', {
      type: 'button', className: 'usual', title: 'back to the default',
      onclick: () => this.set(this.parameter.default)});
    this.editor = element('div', {className: 'editor'});
    this.build(id);
    this.row = element('div', {className: 'control', id},
      element('div', {className: 'about'},
        element('label', {htmlFor: `${id}-0`, textContent: name.split('.').at(-1)}),
        element('span', {className: 'unit', textContent: unit || ''}), this.usual),
      this.editor,
      element('p', {className: 'description', id: `${id}-about`, textContent: description}),
      this.error);
    this.row.dataset.text = `${name} ${words(name)} ${description} ${type}`.toLowerCase();
    this.update(parameter);
  }

  build(id) {
    const {type, choices} = this.parameter;
    this.inputs = [];
    if (type === 'bool') this.flag(id);
    else if (type === 'string' && choices) this.choice(id, choices);
    else if (/^(double|integer)/.test(type)) this.numbers(id);
    else this.text(id);
    const off = this.parameter.read_only || this.panel.readOnly;
    for (const input of this.editor.querySelectorAll('input, select')) {
      input.disabled = off;
      input.setAttribute('aria-describedby', `${id}-about`);
    }
    this.usual.disabled = off;
  }

  flag(id) {
    const box = element('input', {type: 'checkbox', id: `${id}-0`, role: 'switch',
                                  onchange: () => this.set(box.checked)});
    this.editor.append(box);
    this.show = value => { box.checked = value; };
  }

  choice(id, choices) {
    const select = element('select', {id: `${id}-0`, onchange: () => this.set(select.value)},
      ...choices.map(value => element('option', {value, textContent: solverName(value)})));
    this.editor.append(select);
    this.show = value => { select.value = value; };
  }

  text(id) {
    const list = this.parameter.type.endsWith('[]');
    const input = element('input', {type: 'text', id: `${id}-0`, onchange: () => this.set(
      list ? input.value.split(',').map(each => each.trim()).filter(Boolean) : input.value)});
    this.editor.append(input);
    this.show = value => { input.value = list ? value.join(', ') : value; };
  }

  /** A slider and a field for a number, or for each number of a list. */
  numbers(id) {
    const list = this.parameter.type.endsWith('[]');
    const values = list ? this.parameter.value : [this.parameter.value];
    const {links, scale: {length, time}} = this.panel;
    const names = list && values.length === 2 * links + 2 ? symbols(links) : [];
    const sizes = names.map((_, n) => (n % (links + 1) ? 1 : length) / (n > links ? time : 1));
    const pick = (parts, n) => list ? parts?.[n] : parts;
    const seconds = element('span', {className: 'unit', id: `${id}-seconds`});
    const rows = values.map((value, n) => {
      const scale = scaleOf({...this.parameter, value, default: pick(this.parameter.default, n),
                             times: sizes[n]});
      const label = `${this.parameter.name}${list ? ` ${names[n] ?? n + 1}` : ''}`;
      const slider = element('input', {type: 'range', min: 0, max: 1, step: 'any',
                                       id: `${id}-${n}`, 'aria-label': label});
      const field = element('input', {type: 'text', inputMode: 'decimal', className: 'number',
                                      'aria-label': `${label}, as a number`});
      slider.oninput = () => {
        field.value = scale.to(Number(slider.value));
        tell(scale.to(Number(slider.value)));
        this.set(collect(n, scale.to(Number(slider.value))), true);
      };
      slider.onchange = () => this.set(collect(n, scale.to(Number(slider.value))));
      slider.onkeydown = event => {
        const way = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1}[event.key];
        if (!way) return;
        event.preventDefault();
        const before = scale.to(Number(slider.value));
        slider.value = clamp(Number(slider.value) + way / 50, 0, 1);
        const stays = scale.to(Number(slider.value)) === before;   // the next whole number is farther
        if (stays && Number.isInteger(before)) slider.value = clamp(scale.from(before + way), 0, 1);
        slider.oninput();
      };
      field.oninput = () => { this.typed = field; };   // which nobody else writes to meanwhile
      field.onblur = () => { this.typed = null; };
      field.onchange = () => {
        this.typed = null;
        this.set(collect(n, field.value.trim()));
      };
      const mark = element('i', {className: 'default'});
      const usual = pick(this.parameter.default, n);
      mark.hidden = typeof usual !== 'number';
      if (!mark.hidden) mark.style.setProperty('--at', clamp(scale.from(usual), 0, 1));
      this.editor.append(element('div', {className: 'slider'},
        ...(list ? [element('span', {className: 'index', textContent: names[n] ?? n + 1})] : []),
        element('div', {className: 'rail'}, slider, mark), field));
      return {slider, field, scale};
    });
    // of steps a user knows their time
    const tell = steps => {
      const step = this.panel.value(this.node, 'step');
      seconds.textContent = step ? `= ${short(steps * step)} s` : '';
    };
    if (this.parameter.name === 'horizon') this.editor.append(seconds);
    const collect = (n, value) => {
      const part = typeof value === 'number' ? value : this.parse(value);
      return list ? this.wanted.map((old, i) => i === n ? part : old) : part;
    };
    this.show = value => rows.forEach(({slider, field, scale}, n) => {
      const part = list ? value[n] : value;
      tell(part);
      if (document.activeElement !== slider || !this.busy) {
        slider.value = typeof part === 'number' ? scale.from(part) : 1;
        slider.setAttribute('aria-valuetext', `${part ?? 'infinite'} ${this.parameter.unit ?? ''}`);
      }
      if (this.typed === field) return;
      field.value = part === null ? 'inf' : Number.isInteger(part) ? part : Number(part.toPrecision(6));
    });
  }

  /** Return a number that was typed, or the text as it is, so that the node says what is wrong. */
  parse(text) {
    const plain = text.replace('−', '-');
    return plain !== '' && Number.isFinite(Number(plain)) ? Number(plain) : text;
  }

  /** Ask the node for a value; while a slider moves, one at a time and not too often. */
  async set(value, moving = false) {
    this.wanted = value;
    if (this.busy) return;
    this.busy = true;
    const asked = value;
    const answer = await this.panel.set(this.node, this.parameter.name, asked);
    if (answer.ok) this.parameter = {...this.parameter, value: asked === 'inf' ? null : asked};
    this.error.hidden = answer.ok;
    this.error.textContent = answer.ok ? '' : answer.text;
    this.row.classList.toggle('refused', !answer.ok);
    if (moving) await new Promise(resolve => setTimeout(resolve, SOONEST));
    this.busy = false;
    if (!same(this.wanted, asked)) this.set(this.wanted, true);   // also where one on the way was refused
    else this.update(this.parameter);
  }

  /** Take what the node has now. */
  update(parameter) {
    this.parameter = {...this.parameter, ...parameter};
    if (this.busy) return;
    const {value, default: usual} = this.parameter;
    this.wanted = value;
    this.show(value);
    const changed = usual !== null && usual !== undefined && !same(value, usual);
    this.row.classList.toggle('changed', changed);
    this.usual.hidden = !changed;
    this.usual.textContent = `↺ ${shown(usual)}`;
    this.usual.setAttribute('aria-label', `${this.parameter.name} back to its default ${shown(usual)}`);
  }
}

export class Controls {
  controls = {};     // by node and name
  readOnly = false;
  links = 2;
  scale = {length: 1, time: 1};

  constructor(socket) {
    this.socket = socket;
    this.search = find('#search');
    this.search.addEventListener('input', () => this.filter());
    find('#preset').addEventListener('change', event => this.preset(event.target));
  }

  configure({read_only, replay, links, scale, presets}) {
    const state = () => [this.readOnly, this.links, rounded(this.scale.length)].join();
    const before = state();
    this.readOnly = read_only || replay;
    [this.links, this.scale] = [links, scale];
    if (before !== state()) {
      this.controls = {};
      find('#parameters').replaceChildren();
    }
    const select = find('#preset');
    select.replaceChildren(element('option', {value: '', textContent: 'Presets …'}),
      ...presets.map(value => element('option', {value, textContent: words(value)})));
    select.disabled = this.readOnly || presets.length === 0;
  }

  async preset(select) {
    const name = select.value;
    select.value = '';
    if (name) this.say(await this.socket.ask({do: 'preset', name}), `preset ${words(name)} is set`);
  }

  /** Tell an answer in the line that all see and screen readers hear. */
  say(answer, done) {
    clearTimeout(this.said);
    this.said = setTimeout(() => { find('#notice').textContent = ''; }, SAID);
    find('#notice').textContent = answer.ok ? answer.text || done : answer.text;
    find('#notice').classList.toggle('error', !answer.ok);
  }

  value(node, name) {
    return this.controls[node]?.[name]?.parameter.value;
  }

  set(node, name, value) {
    return this.socket.ask({do: 'set', node, parameters: {[name]: value}});
  }

  onParameters({node, parameters}) {
    const own = this.controls[node] ?? {}, names = parameters.map(({name}) => name);
    const sized = ({name, value}) => !Array.isArray(value) || !own[name] ||
      own[name].parameter.value.length === value.length || own[name].parameter.type === 'string[]';
    if (Object.keys(own).join() === names.join() && parameters.every(sized)) {
      for (const parameter of parameters) own[parameter.name].update(parameter);
    } else {
      this.build(node, parameters);
    }
    this.controls[node]?.horizon?.update({});   // in seconds, by the step
    const solver = parameters.find(({name}) => name === 'solver')?.value;
    if (node === 'mpc' && solver && solver !== this.solver) {
      const groups = document.querySelectorAll('#parameters-mpc details');
      for (const group of groups) {
        if (group.dataset.name === solver) group.open = true;
        else if (group.dataset.name === this.solver) group.open = false;
      }
      this.solver = solver;
    }
  }

  build(node, parameters) {
    const names = parameters.map(({name}) => name), groups = new Map([[FIRST, []]]);
    this.controls[node] = {};
    for (const parameter of parameters) {
      const group = groupOf(parameter.name, node, this.solver, names);
      if (!groups.has(group)) groups.set(group, []);
      groups.get(group).push(this.controls[node][parameter.name] = new Control(node, parameter, this));
    }
    const rank = ({parameter: {name}}) => AT_HAND[node]?.indexOf(name) ?? 0;
    groups.get(FIRST).sort((a, b) => rank(a) - rank(b));
    const order = [...groups].filter(([, controls]) => controls.length)
      .sort(([a], [b]) => (a === REST) - (b === REST));
    const section = element('section', {id: `parameters-${node}`},
      element('h3', {textContent: node}),
      ...order.map(([name, controls]) => {
        const details = element('details', {open: name === FIRST},
          element('summary', {}, name === FIRST ? FIRST : solverName(name),
                  element('small')),
          ...controls.map(({row}) => row));
        details.dataset.name = name;
        return details;
      }));
    find(`#parameters-${node}`)?.remove();
    find('#parameters').append(section);
    for (const each of ['mpc', 'plant']) {
      const there = find(`#parameters-${each}`);
      if (there) find('#parameters').append(there);
    }
    this.filter();
  }

  /** Show the parameters in whose name or description each of the words is. */
  filter() {
    const wanted = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = [...document.querySelectorAll('.control')];
    for (const row of rows) row.hidden = !wanted.every(word => row.dataset.text.includes(word));
    for (const group of document.querySelectorAll('#parameters details')) {
      const all = group.querySelectorAll('.control').length;
      const count = group.querySelectorAll('.control:not([hidden])').length;
      group.hidden = count === 0;
      group.querySelector('small').textContent = wanted.length ? `${count} of ${all}` : all;
      if (wanted.length) {
        group.dataset.was ??= group.open ? 'open' : 'closed';
        group.open = true;
      } else if (group.dataset.was) {
        group.open = group.dataset.was === 'open';
        delete group.dataset.was;
      }
    }
    const count = rows.filter(({hidden}) => !hidden).length;
    find('#found').textContent = !wanted.length ? '' : !count ? 'nothing matches'
      : `${count} of ${rows.length} parameters match`;
  }
}
