// Shows the raymaps of a running rig: keeps at most two questions for a newer one on their way, says how old the picture
// is, and turns it grey when it is old. While the page is hidden it asks for nothing. No drawing.

import { kAsStored } from "./stage.js";

const kOutstanding = 2; // questions on their way: with one, the line would be idle while an answer travels
const kAgain = 500; // ms, until the next question when the program did not answer
const kOld = 2000; // ms: the picture is shown grey
const kLate = 100; // ms, between two looks at the age
const kWindow = 30000; // ms: clocks drift apart, so that what was seen before the last two windows does not count

/// The program's clock minus this page's, by the answer that travelled fastest in the last one or two windows.
class ClockDifference {
  constructor() {
    this.before = this.now = -Infinity;
    this.since = performance.now();
  }
  add(sent) {
    const here = performance.now();
    if (here - this.since > kWindow) {
      this.before = this.now;
      this.now = -Infinity;
      this.since = here;
    }
    this.now = Math.max(this.now, sent - here);
  }
  get value() {
    return Math.max(this.before, this.now);
  }
}

/// `setPicture(bitmap)` draws; `say(text)` tells people; `stage` gets the class "old". `refused(status)` is called when
/// the program refuses to show anything.
export function watchRig(setPicture, say, stage, output, refused = () => {}) {
  const clock = new ClockDifference();
  const pending = new Set(); // the pictures after which those on their way are asked for
  let number = 0, outstanding = 0, exposed = null, of = "", problem = "", pictures = 0, said = false;

  const take = async (answer) => {
    problem = answer.headers.get("X-Problem") ?? "";
    if (answer.status !== 200) {
      if (answer.status < 400) return;
      refused(answer.status);
      throw new Error("no answer");
    }
    const sent = Number(answer.headers.get("X-Clock-Ms")), its = Number(answer.headers.get("X-Number"));
    clock.add(sent);
    const bitmap = await createImageBitmap(await answer.blob(), kAsStored);
    if (its <= number) return bitmap.close(); // a newer one is shown already
    number = its;
    of = answer.headers.get("X-Age-Of");
    exposed = sent - Number(answer.headers.get("X-Age-Ms"));
    setPicture(bitmap);
    ++pictures;
  };
  const ask = async () => {
    ++outstanding;
    const after = pending.has(number) ? number + 1 : number; // the second is for the picture after the first's
    pending.add(after);
    let wait = 0;
    try {
      await take(await fetch(`live?after=${after}`));
    } catch {
      problem = "the program has ended, or the network is gone";
      wait = kAgain;
      number = 0; // a program that starts again counts from 1
    }
    pending.delete(after);
    setTimeout(() => { --outstanding; keepAsking(); }, wait);
  };
  const keepAsking = () => {
    while (!document.hidden && outstanding < kOutstanding) ask();
  };
  const look = () => {
    if (exposed === null) return;
    const age = performance.now() + clock.value - exposed, old = age > kOld;
    stage.classList.toggle("old", old);
    const seconds = (age / 1000).toFixed(age < 10000 ? 2 : 0);
    output.textContent = `picture ${seconds} s old${of === "arrival" ? " since it came" : ""}`;
    Object.assign(output.dataset, { age: Math.round(age), pictures, number });
    const why = problem || "no newer picture came";
    if (old && !document.hidden) say(`The rig is gone or stands still: ${why}. The picture is ${seconds} s old.`);
    else if (said) say("");
    said = old;
  };
  document.addEventListener("visibilitychange", keepAsking);
  keepAsking();
  setInterval(look, kLate);
}
