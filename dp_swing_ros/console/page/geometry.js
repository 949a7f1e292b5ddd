// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Where cart and links are, and states between states. Angles are absolute, 0 is upright.

const RESET = 1;   // [lengths of a link, rad] by which nothing leaves the way of its speeds; it was put there

export const linksOf = x => x.length / 2 - 1;
const finite = x => x.every(Number.isFinite);

/** Return the places [m] of the cart and the ends of the links, x to the right and z up. */
export function joints(x, lengths) {
  const places = [[x[0], 0]];
  for (let n = 0; n < linksOf(x); n++) {
    const [left, low] = places[n];
    places.push([left + lengths[n] * Math.sin(x[n + 1]), low + lengths[n] * Math.cos(x[n + 1])]);
  }
  return places;
}

export const tip = (x, lengths) => joints(x, lengths).at(-1);

/** Return an angle in (-π, π]. */
export const wrapped = angle => angle - 2 * Math.PI * Math.ceil(angle / 2 / Math.PI - 0.5);

/**
 * Return the state at the share s of the time h [s] from a to b, by cubics; b where there is none.
 * Links have a length [m].
 */
export function between(a, b, s, h, length) {
  const count = b.length / 2;
  if (!a || a.length !== b.length || !finite(a) || !finite(b)) return b;
  const x = new Array(b.length);
  for (let i = 0; i < count; i++) {
    const speedA = a[count + i] * h, speedB = b[count + i] * h;
    let way = b[i] - a[i];
    const off = way - (speedA + speedB) / 2, turns = i > 0 ? Math.round(off / 2 / Math.PI) : 0;
    way -= 2 * Math.PI * turns;
    if (Math.abs(off - 2 * Math.PI * turns) > RESET * (i > 0 ? 1 : length)) return b;
    const from = b[i] - way, rest = 1 - s;
    x[i] = (1 + 2 * s) * rest * rest * from + s * rest * rest * speedA +
      s * s * (3 - 2 * s) * b[i] - s * s * rest * speedB;
    x[count + i] = rest * a[count + i] + s * b[count + i];
  }
  return x;
}

/** Return the state at a time in a list of times and states; the first and last hold beyond. */
export function at(time, times, states, length) {
  let low = 0, high = times.length - 1;
  if (high < 0) return null;
  if (time >= times[high]) return states[high];
  if (time <= times[0]) return states[0];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  const h = times[high] - times[low];
  return between(states[low], states[high], (time - times[low]) / h, h, length);
}

/** Return the place of a plan's state at a time [s] after its first. */
export function ahead(plan, after, length) {
  const n = Math.min(Math.max(after / plan.dt, 0), plan.X.length - 1), low = Math.floor(n);
  return low === n ? plan.X[low] : between(plan.X[low], plan.X[low + 1], n - low, plan.dt, length);
}

/** Return the body (0 the cart) nearest to a point, where along it, and how far away [m]. */
export function nearest(places, [px, pz], [width, height]) {
  const [x, z] = places[0];
  const out = [Math.max(Math.abs(px - x) - width / 2, 0), Math.max(Math.abs(pz - z) - height / 2, 0)];
  let found = {body: 0, along: 0, distance: Math.hypot(...out)};
  for (let n = 1; n < places.length; n++) {
    const [ax, az] = places[n - 1], dx = places[n][0] - ax, dz = places[n][1] - az;
    const share = ((px - ax) * dx + (pz - az) * dz) / (dx * dx + dz * dz);
    const along = Math.min(Math.max(share, 0), 1);
    const distance = Math.hypot(px - ax - along * dx, pz - az - along * dz);
    if (distance < found.distance) found = {body: n, along, distance};
  }
  return found;
}

/** Return the place [m] on a body that was found so. */
export function placeOn(places, {body, along}) {
  if (body === 0) return places[0];
  const [a, b] = [places[body - 1], places[body]];
  return [a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])];
}
