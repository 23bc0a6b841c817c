// Plays the pictures of a film: asks for them by their number, at most two at a time, and shows each at its time. No
// drawing.

const kOutstanding = 2; // requests: with more, a slow link would deliver late what is not wanted any more
const kAhead = 4; // pictures that are decoded before their time

export class Player {
  /// `times`: ms since the first picture. `load(k)` gives picture k; `show(k, picture)` shows it; `failed(error)`.
  constructor(times, { load, show, failed }) {
    this.times = times;
    this.length = times.at(-1) + (times.length > 1 ? times.at(-1) / (times.length - 1) : 0);
    Object.assign(this, { load, show, failed });
    this.shown = -1;
    this.playing = false;
    this.asked = new Set();
    this.ready = new Map();
    this.dropped = 0; // pictures that were not shown while the film played
    this.drawn = 0; // pictures that were shown while it played
    this.frame = () => this.tick(performance.now());
  }

  /// The picture of a time, ms.
  at(time) {
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  play() {
    if (this.playing || this.times.length < 2) return;
    this.playing = true;
    if (this.shown === this.times.length - 1) this.shown = -1;
    this.from = this.times[Math.max(0, this.shown)];
    this.began = performance.now();
    this.dropped = this.drawn = 0;
    requestAnimationFrame(this.frame);
  }

  pause() {
    this.playing = false;
    this.forget();
  }

  /// Shows picture k as soon as it is there.
  seek(k) {
    this.wanted = Math.max(0, Math.min(this.times.length - 1, k));
    if (this.playing) {
      this.forget();
      this.shown = this.wanted - 1;
      this.from = this.times[this.wanted];
      this.began = performance.now();
      return;
    }
    this.fetchWanted();
  }

  step(by) {
    const from = this.wanted ?? Math.max(0, this.shown);
    this.pause();
    this.seek(from + by);
  }

  forget() {
    for (const picture of this.ready.values()) picture.close?.();
    this.ready.clear();
    this.wanted = undefined;
  }

  /// The picture that was asked for last, while the film stands; those asked for before it are left out.
  async fetchWanted() {
    if (this.asked.size >= kOutstanding) return;
    const k = this.wanted;
    this.asked.add(k);
    try {
      const picture = await this.load(k);
      if (!this.playing) {
        this.shown = k;
        this.show(k, picture);
      }
    } catch (error) {
      this.failed(error);
    }
    this.asked.delete(k);
    if (!this.playing && this.wanted !== undefined && this.wanted !== this.shown) this.fetchWanted();
  }

  async fetch(k) {
    this.asked.add(k);
    try {
      const picture = await this.load(k);
      if (this.playing && k > this.shown) this.ready.set(k, picture);
      else picture.close?.();
    } catch (error) {
      this.pause();
      this.failed(error);
    }
    this.asked.delete(k);
  }

  tick(now) {
    if (!this.playing) return;
    const time = this.from + (now - this.began);
    const due = this.at(time);
    const newest = Math.max(...[...this.ready.keys()].filter((k) => k <= due), -1);
    if (newest > this.shown) {
      if (this.shown >= 0) this.dropped += newest - this.shown - 1;
      ++this.drawn;
      this.shown = newest;
      this.show(newest, this.ready.get(newest));
      for (const k of this.ready.keys()) {
        if (k < newest) this.ready.get(k).close?.();
        if (k <= newest) this.ready.delete(k);
      }
    }
    if (this.shown === this.times.length - 1 && time >= this.length) {
      this.pause();
      this.ended?.();
      return;
    }
    let next = Math.max(this.shown + 1, due, ...[...this.asked, ...this.ready.keys()].map((k) => k + 1));
    while (this.asked.size < kOutstanding && this.ready.size < kAhead && next < this.times.length) this.fetch(next++);
    requestAnimationFrame(this.frame);
  }
}
