// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Elements of the page, and numbers and names as it writes them.

/** Make an element with properties (or attributes) and children. */
export function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in node) node[name] = value; else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

export const find = selector => document.querySelector(selector);

/** Return a number as text with a true minus, `-` where there is none. */
export function number(value, digits = 2) {
  if (typeof value !== 'number' || !Number.isFinite(value)) return '–';
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace('-', '') : text).replace('-', '−');
}

/** Return how many decimals show as much of what is so many times larger than usual. */
export const decimals = (usual, times) => Math.max(usual - Math.round(Math.log10(times)), 0);

/** Return the round number nearest to a positive one: 1, 2, 2.5 or 5 times a power of ten. */
export function rounded(value) {
  const power = 10 ** Math.floor(Math.log10(value)), off = step => Math.abs(Math.log(step * power / value));
  return power * [1, 2, 2.5, 5, 10].reduce((best, step) => off(step) < off(best) ? step : best);
}

/** Return a number of any size in few characters. */
export function short(value) {
  if (typeof value !== 'number' || !Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size < 1e-9) return '0';
  if (size >= 1e5 || (size > 0 && size < 1e-3)) return value.toExponential(1).replace('-', '−');
  return number(value, size >= 100 || Number.isInteger(value) ? 0 : size >= 10 ? 1 : size >= 0.1 ? 2 : 3);
}

/** Return [value, text] of the ticks of an axis, all with the same digits, or the same exponent. */
export function ticked(values) {
  const most = Math.max(...values.map(Math.abs)), step = Math.abs(values[1] - values[0]);
  const power = Math.floor(Math.log10(most || 1)), far = power >= 5 || power < -3;
  const digits = [0, 1, 2, 3, 4, 5].find(n => {
    const part = (far ? step / 10 ** power : step) * 10 ** n;
    return Math.abs(part - Math.round(part)) < 1e-6;
  }) ?? 2;
  return values.map(value => [value, value === 0 ? '0' : far ? `${number(value / 10 ** power, digits)}e${power}`.replace('-', '−')
    : number(value, digits)]);
}

/** Return a quantity with its unit, a dash where there is none. */
export const measure = (value, digits, unit) =>
  Number.isFinite(value) ? `${number(value, digits)} ${unit}` : '–';

const SOLVERS = {ilqr: 'iLQR', ddp: 'DDP', mppi: 'MPPI'};
export const solverName = name => SOLVERS[name] ?? name;

const SUBSCRIPTS = '₀₁₂₃';
/** Return the symbols of a state's numbers in order: x, θ₁ …, ẋ, θ̇₁ …. */
export function symbols(links) {
  const angles = Array.from({length: links}, (_, n) => SUBSCRIPTS[n + 1]);
  return ['x', ...angles.map(n => `θ${n}`), 'ẋ', ...angles.map(n => `θ̇${n}`)];
}

export const words = name => name.replaceAll('_', ' ');
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
