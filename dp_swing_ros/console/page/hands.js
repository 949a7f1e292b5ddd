// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// Hands on: drag cart or links, click on the track, push with the keys.

import {BELOW_TRACK} from './draw.js';
import {nearest, placeOn} from './geometry.js';
import {clamp, decimals} from './dom.js';

const NEAR = {mouse: 24, pen: 28, touch: 40};  // [px] from a body that it is still meant
const TRACK_BAND = 0.45;    // [m] scaled, below the track where a click moves the reference
const SOONEST = 16, RENEWED = 100;  // [ms] between two messages of a pull
const ARROW_FORCE = 10;     // [N] scaled, while an arrow key is held

export class Hands {
  pointer = null;     // that holds
  sent = 0;           // [ms] when the last pull was sent
  moved = false;      // since then
  since = null;       // [ms] of the first move whose force is not seen yet
  pushing = 0;        // [N] by the arrow keys
  pulled = false;     // a body, since the button went down

  constructor(scene, socket) {
    Object.assign(this, {scene, socket, canvas: scene.canvas});
    this.canvas.addEventListener('pointerdown', event => this.grip(event));
    this.canvas.addEventListener('pointermove', event => this.move(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      this.canvas.addEventListener(end, event => this.release(event));
    }
    // which does not come where a finger has scrolled, but does where a body was held
    this.canvas.addEventListener('click', event => this.aim(event));
    this.canvas.addEventListener('pointerleave', () => { scene.aimed = null; });
    // a finger on a body pulls; elsewhere on the picture it scrolls the page
    this.canvas.addEventListener('touchstart', event => {
      if (this.bodyAt(this.point(event.touches[0]), 'touch')) event.preventDefault();
    }, {passive: false});
    addEventListener('blur', () => this.letGo());
  }

  point({clientX, clientY}) {
    const {left, top} = this.canvas.getBoundingClientRect();
    return this.scene.view?.toWorld([clientX - left, clientY - top]) ?? [0, 0];
  }

  bodyAt(point, kind) {
    if (!this.scene.places || this.frozen || this.refused) return null;
    const found = nearest(this.scene.places, point, this.scene.hello.cart);
    return found.distance * this.scene.view.scale <= (NEAR[kind] ?? 24) ? found : null;
  }

  /** Return where a click at a point moves the reference, null where it does not. */
  trackAt([x, z]) {
    const {limits, scale} = this.scene.hello ?? {};
    if (!limits || this.frozen || this.refused) return null;
    const {length} = scale, below = length * BELOW_TRACK, fine = 10 ** decimals(2, length);
    if (z > below || z < below - TRACK_BAND * length) return null;
    const end = limits.track ?? Infinity;
    return Math.abs(x) > end + 0.2 * length ? null : clamp(Math.round(fine * x) / fine, -end, end);
  }

  grip(event) {
    if (event.button !== 0 || this.pointer !== null) return;
    this.pulled = false;
    const point = this.point(event), body = this.bodyAt(point, event.pointerType);
    if (!body) return;
    this.pointer = event.pointerId;
    this.pulled = true;
    this.canvas.setPointerCapture(event.pointerId);
    this.scene.held = {...body, to: placeOn(this.scene.places, body)};
    this.canvas.classList.add('held');
    this.moved = true;
    event.preventDefault();
    this.canvas.focus({preventScroll: true});
  }

  /** Move the reference to where the track was clicked on. */
  aim(event) {
    const point = this.point(event);
    if (this.pulled || this.bodyAt(point, event.pointerType)) return;
    const place = this.trackAt(point);
    if (place !== null) this.onReference?.(place);
  }

  move(event) {
    const point = this.point(event);
    if (event.pointerId !== this.pointer) {
      if (event.pointerType !== 'mouse') return;
      const body = this.bodyAt(point, 'mouse');
      this.scene.aimed = body ? null : this.trackAt(point);
      this.canvas.classList.toggle('grab', Boolean(body));
      this.canvas.classList.toggle('aim', this.scene.aimed !== null);
      return;
    }
    this.scene.held.to = point;
    this.moved = true;
    this.since ??= event.timeStamp;
  }

  release(event) {
    if (event.pointerId === this.pointer) this.letGo();
  }

  letGo() {
    if (this.pointer !== null || this.pushing) this.socket.send({do: 'release'});
    this.canvas.classList.remove('held');
    [this.pointer, this.scene.held, this.pushing, this.since] = [null, null, 0, null];
  }

  /** Hold a push by the keys to a side; 0 ends it. */
  push(way) {
    const force = way * ARROW_FORCE * (this.scene.hello?.scale.force ?? 1);
    if (force === this.pushing || this.refused) return;
    if (way === 0) { this.letGo(); return; }
    [this.pushing, this.moved] = [force, true];
  }

  /** Send what is held, when it has moved or is to be renewed; call at each frame. */
  renew(now) {
    const {held} = this.scene, since = now - this.sent;
    if (!(held || this.pushing) || since < (this.moved ? SOONEST : RENEWED)) return;
    [this.sent, this.moved] = [now, false];
    if (held) this.socket.send({do: 'pull', body: held.body, along: held.along, to: held.to});
    else this.socket.send({do: 'hold', force: this.pushing});
  }

  /** Measure, once it is drawn, how long a drag took until its force was seen. */
  seen(frame) {
    if (!Number.isFinite(this.since ?? NaN) || !frame?.push) return;
    performance.measure('drag-to-visible', {start: this.since, end: performance.now()});
    this.since = Infinity;   // once for each drag
  }
}
