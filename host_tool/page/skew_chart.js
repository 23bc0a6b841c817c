// How far the heads' exposures are apart, as a strip chart: what the rig said at each question of the last two minutes,
// with the limit within which nodald counts heads as in step.

const kWide = 120000; // ms
const kLimitNs = 500000; // Genlock::kLockLimit of nodald
const kTall = 40, kLong = 240; // units of the drawing

const micros = (ns) => `${(ns / 1000).toFixed(ns < 10000 ? 1 : 0)} µs`;

export class SkewChart {
  /// `svg` has a line and a path; `words` gets the same as text.
  constructor(svg, words) {
    this.svg = svg;
    this.words = words;
    this.values = []; // times and spreads; a spread of null: heads are not held in step
  }

  /// `spread`: latest minus earliest middle of the newest set's exposures, ns; null while genlock is off.
  add(spread, now = performance.now()) {
    this.values.push({ now, spread });
    while (now - this.values[0].now > kWide) this.values.shift();
    const known = this.values.filter((each) => each.spread !== null).map((each) => each.spread);
    const largest = Math.max(0, ...known), top = Math.max(2 * kLimitNs, largest * 1.1);
    const y = (value) => (kTall * (1 - value / top)).toFixed(2);
    const line = this.svg.querySelector("line");
    line.setAttribute("y1", y(kLimitNs));
    line.setAttribute("y2", y(kLimitNs));
    let drawn = "", before = null;
    for (const each of this.values) {
      if (each.spread !== null) {
        const x = (kLong * (1 - (now - each.now) / kWide)).toFixed(2);
        drawn += `${before === null ? "M" : "L"}${x} ${y(each.spread)}`;
      }
      before = each.spread;
    }
    this.svg.querySelector("path").setAttribute("d", drawn);
    const over = known.filter((each) => each > kLimitNs).length;
    const text = known.length === 0 ? "Genlock is off: the heads are not held in step."
      : `Apart: ${spread === null ? "not known" : micros(spread)} now, at most ${micros(largest)} in the last two minutes; ` +
        `the limit is ${micros(kLimitNs)}${over > 0 ? `, and ${over} of ${known.length} values were over it` : ""}.`;
    this.svg.classList.toggle("bad", spread !== null && spread > kLimitNs);
    Object.assign(this.svg.dataset, { over, values: known.length });
    if (this.words.textContent !== text) this.words.textContent = text;
  }
}
