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

/** Return a number of any size in few characters. */
export function short(value) {
  if (typeof value !== 'number' || !Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size < 1e-9) return '0';
  if (size >= 1e5 || (size > 0 && size < 1e-3)) return value.toExponential(1).replace('-', '−');
  return number(value, size >= 100 || Number.isInteger(value) ? 0 : size >= 10 ? 1 : size >= 0.1 ? 2 : 3);
}

const SOLVERS = {ilqr: 'iLQR', ddp: 'DDP', mppi: 'MPPI', sampled_ilqr: 'sampled iLQR'};
export const solverName = name => SOLVERS[name] ?? name;

const SUBSCRIPTS = '₀₁₂₃';
/** Return the symbols of a state's numbers in order: x, θ₁ …, ẋ, θ̇₁ …. */
export function symbols(links) {
  const angles = Array.from({length: links}, (_, n) => SUBSCRIPTS[n + 1]);
  return ['x', ...angles.map(n => `θ${n}`), 'ẋ', ...angles.map(n => `θ̇${n}`)];
}

export const words = name => name.replaceAll('_', ' ');
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
