// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Colours of the drawings, from style.css, where they are for light and for dark.

const NAMES = ['ink', 'faint', 'line', 'panel', 'soft', 'accent', 'force', 'push', 'alarm',
  'link1', 'link2', 'link3', 'c1', 'c2', 'c3', 'c4', 'c5', 'c6', 'c7'];

export const colours = {};

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
}

read();
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', read);

export const linkColour = n => colours[`link${n + 1}`];

const OWN = {ilqr: 'c1', ddp: 'c2', mppi: 'c3'};
/** Return a solver's colour, the same everywhere; another's is one that is left. */
export const solverColour = (name, n = 0) => colours[OWN[name] ?? ['c5', 'c6', 'c4'][n % 3]];
