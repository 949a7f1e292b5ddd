// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// The one connection to the console: what comes goes to who asked for its kind; lost, it is made anew.

const FIRST_WAIT = 500, LONGEST_WAIT = 8000;  // [ms]
const SILENT = 5000;  // [ms] without a word, where the console gives a sign of life each second
const LOST = {kind: 'answer', ok: false, text: 'the console is not connected'};

export class Socket {
  handlers = new Map();
  asked = new Map();  // by id, what to call with the answer
  id = 0;
  wait = FIRST_WAIT;

  constructor(url) {
    this.url = url;
    setInterval(() => this.listen(), 1000);
  }

  /** Call a handler with each message of a kind; `open` and `closed` are kinds, too. */
  on(kind, handler) {
    if (!this.handlers.has(kind)) this.handlers.set(kind, []);
    this.handlers.get(kind).push(handler);
  }

  connect() {
    clearTimeout(this.again);
    this.leave();
    this.heard = performance.now();
    this.web = new WebSocket(this.url);
    this.web.onopen = () => { this.wait = FIRST_WAIT; this.deal({kind: 'open'}); };
    this.web.onmessage = event => {
      this.heard = performance.now();
      this.deal(JSON.parse(event.data));
    };
    this.web.onclose = event => this.lose(event);
  }

  /** Give a connection up on which nothing comes, as of a console that hangs or is out of reach. */
  listen() {
    if (this.web && performance.now() - this.heard > SILENT) this.lose({reason: ''});
  }

  leave() {
    if (!this.web) return;
    this.web.onopen = this.web.onmessage = this.web.onclose = null;
    this.web.close();
    this.web = null;
  }

  lose(event) {
    this.leave();
    for (const answer of this.asked.values()) answer(LOST);
    this.asked.clear();
    this.deal({kind: 'closed', reason: event.reason, wait: this.wait});
    this.again = setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
  }

  deal(message) {
    const answer = message.kind === 'branch' ? null : this.asked.get(message.id);
    if (answer) {
      this.asked.delete(message.id);
      answer(message);
    }
    for (const handler of this.handlers.get(message.kind) ?? []) handler(message);
  }

  get open() {
    return this.web?.readyState === WebSocket.OPEN;
  }

  /** Send what needs no answer. */
  send(message) {
    if (this.open) this.web.send(JSON.stringify(message));
  }

  /** Send a request; resolves with its answer, which says what went wrong. */
  ask(message) {
    if (!this.open) return Promise.resolve(LOST);
    const id = ++this.id;
    this.send({...message, id});
    return new Promise(resolve => this.asked.set(id, resolve));
  }
}
