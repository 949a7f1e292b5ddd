// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Strokes of the pictures: a canvas in metres, and the parts of a pendulum on its track.

import {colours, linkColour} from './colours.js';
import {rounded, ticked} from './dom.js';

// all lengths and forces are of the default bodies, and scaled for others: [m], [m/N], [m], [N]
const ARROW = {gap: 0.05, scale: 0.05, head: 0.16, least: 0.3};
const THINNER = 0.6;   // is each link than the one before, which it may lie on
const TRACK = -0.15, STOP = 0.25;  // [m] height of the track below the joint, and of its stops

/** Fit a canvas to its place on the page; return its pen and its size in CSS pixels. */
export function fit(canvas) {
  const ratio = Math.min(devicePixelRatio, 2);
  const {clientWidth: width, clientHeight: height} = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext('2d');
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return {pen, width, height};
}

/** Metres to pixels: what of the world is seen, with the cart's joint at a height of the canvas. */
export class View {
  constructor(width, height, halfWidth, reach) {
    this.scale = Math.min(width / 2 / halfWidth, height / 2 / reach);
    this.origin = [width / 2, height / 2];
  }

  toScreen([x, z]) {
    return [this.origin[0] + x * this.scale, this.origin[1] - z * this.scale];
  }

  toWorld([left, top]) {
    return [(left - this.origin[0]) / this.scale, (this.origin[1] - top) / this.scale];
  }
}

/** What draws in metres on a pen, so many times larger than the default bodies. */
export class Brush {
  constructor(pen, view, {length, force}) {
    Object.assign(this, {pen, view, length, force});
  }

  path(points) {
    this.pen.beginPath();
    points.forEach((point, n) => {
      const [left, top] = this.view.toScreen(point);
      if (n) this.pen.lineTo(left, top); else this.pen.moveTo(left, top);
    });
  }

  /** Draw a line of a thickness [px]. */
  line(points, colour, thickness, alpha = 1, dash = [], cap = 'round') {
    const {pen} = this;
    this.path(points);
    [pen.strokeStyle, pen.lineWidth, pen.globalAlpha] = [colour, thickness, alpha];
    [pen.lineCap, pen.lineJoin] = [cap, 'round'];
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  dot(point, radius, fill, edge = null, alpha = 1) {
    const {pen} = this;
    pen.globalAlpha = alpha;
    pen.beginPath();
    pen.arc(...this.view.toScreen(point), radius, 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.fill();
    if (edge) { [pen.strokeStyle, pen.lineWidth] = [edge, 1.5]; pen.stroke(); }
    pen.globalAlpha = 1;
  }

  text(words, point, colour, shift = [0, 0], align = 'center', size = 12) {
    const {pen} = this, [left, top] = this.view.toScreen(point);
    pen.font = `500 ${size}px system-ui, sans-serif`;
    [pen.textAlign, pen.textBaseline, pen.fillStyle] = [align, 'middle', colour];
    pen.fillText(words, left + shift[0], top + shift[1]);
  }

  /** Lay the track with its soft margin (filled) and its stops; marks each metre. */
  track({track, margin}, [width], labels = true, reference = null) {
    const {pen, view, length} = this, most = 50 * length;
    const end = Math.min(track ?? most, most), edge = end + width / 2;
    const bottom = length * TRACK, height = length * (TRACK + STOP), mark = bottom - 0.05 * length;
    if (track !== null && margin > 0) {
      for (const side of [-1, 1]) {
        const [from] = view.toScreen([side * (end - margin), 0]), [to] = view.toScreen([side * edge, 0]);
        const [, top] = view.toScreen([0, height]), [, low] = view.toScreen([0, bottom]);
        const shade = pen.createLinearGradient(from, 0, to, 0);
        shade.addColorStop(0, `${colours.c5}00`);
        shade.addColorStop(1, `${colours.c5}55`);
        pen.fillStyle = shade;
        pen.fillRect(Math.min(from, to), top, Math.abs(to - from), low - top);
      }
    }
    this.line([[-edge, bottom], [edge, bottom]], colours.faint, 2);
    if (track !== null) {
      for (const side of [-edge, edge]) {
        this.line([[side, bottom], [side, height]], colours.faint, 4);
      }
    }
    if (!labels) return;
    const metre = rounded(length), count = Math.floor(end / metre + 1e-9);
    for (const [x, text] of ticked(Array.from({length: 2 * count + 1}, (_, n) => (n - count) * metre))) {
      this.line([[x, bottom], [x, mark]], colours.faint, 1);
      if (reference !== null && Math.abs(x - reference) < 0.2 * length) continue;  // its mark is there
      this.text(text, [x, mark], colours.faint, [0, 10], 'center', 11);
    }
  }

  /**
   * Draw a cart and its links, places as `joints` tells them; a later one is on top, and thinner.
   * A centre of mass is drawn where it has a share of the length of its link.
   */
  pendulum(places, size, centres) {
    const links = Math.max(4, 0.07 * this.length * this.view.scale);
    this.cart(places[0], size, 1, true);
    for (let n = 1; n < places.length; n++) {
      this.line(places.slice(n - 1, n + 1), linkColour(n - 1), links * THINNER ** (n - 1));
    }
    for (const place of places.slice(0, -1)) this.dot(place, Math.max(2, links / 4), colours.panel);
    centres.forEach((share, n) => {
      if (share === null) return;
      const [from, to] = places.slice(n, n + 2), along = i => from[i] + share * (to[i] - from[i]);
      this.dot([along(0), along(1)], Math.max(3, links / 3), colours.ink, colours.panel);
    });
  }

  cart([x, z], [width, height], alpha, filled, dash = []) {
    const {pen, view} = this, [left, top] = view.toScreen([x - width / 2, z + height / 2]);
    pen.globalAlpha = alpha;
    pen.beginPath();
    pen.roundRect(left, top, width * view.scale, height * view.scale,
                  0.05 * this.length * view.scale);
    if (filled) { pen.fillStyle = colours.ink; pen.fill(); }
    else {
      [pen.strokeStyle, pen.lineWidth] = [colours.ink, 1.5];
      pen.setLineDash(dash);
      pen.stroke();
      pen.setLineDash([]);
    }
    pen.globalAlpha = 1;
  }

  /** Draw only the outline of a pendulum; without a size, only of its links. */
  outline(places, size, alpha, dash) {
    if (size) this.cart(places[0], size, alpha, false, dash);
    for (let n = 1; n < places.length; n++) {
      this.line(places.slice(n - 1, n + 1), linkColour(n - 1), 2, alpha, dash);
    }
  }

  /** Draw a horizontal force [N] as an arrow from a place, beyond a half width [m]. */
  arrow([x, z], force, colour, halfWidth, label = '') {
    if (!(Math.abs(force) >= ARROW.least * this.force)) return;
    const way = Math.sign(force), from = x + way * (halfWidth + ARROW.gap * this.length);
    const length = ARROW.scale * this.length / this.force * Math.abs(force);
    const head = Math.min(ARROW.head * this.length, length);
    const to = from + way * length, neck = to - way * head;
    const thickness = Math.max(3, 0.05 * this.length * this.view.scale);
    if (length > head) this.line([[from, z], [neck, z]], colour, thickness);
    this.path([[to, z], [neck, z + head / 2], [neck, z - head / 2]]);
    this.pen.fillStyle = colour;
    this.pen.fill();
    if (label) this.text(label, [to, z], colour, [way * 6, 0], way > 0 ? 'left' : 'right');
  }
}

export const BELOW_TRACK = TRACK;
