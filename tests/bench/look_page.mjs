// What tests/bench/look measures in the page:  node look_page.mjs LINK film|live SECONDS
import { browser, drawn } from "../browser/browser.mjs";

const [link, what, seconds] = process.argv.slice(2);
const page = await browser.newPage();
await page.setViewport({ width: 1000, height: 700, deviceScaleFactor: 1 });
// When a picture is first drawn, by the page's own clock; `afterFrame` is called after whatever the page does in a frame,
// while the pixels that it drew are still there.
await page.evaluateOnNewDocument(() => {
  const real = globalThis.requestAnimationFrame.bind(globalThis);
  globalThis.requestAnimationFrame = (call) => real((time) => { call(time); globalThis.afterFrame?.(); });
  globalThis.afterFrame = () => {
    if (document.documentElement.dataset.ready) globalThis.first ??= performance.now();
  };
});
await page.goto(link, { waitUntil: "domcontentloaded" });
await page.waitForFunction(() => globalThis.first, { timeout: 120000 });
await drawn(page);
const renderer = await page.evaluate(() => {
  const gl = document.getElementById("view").getContext("webgl2");
  return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
});
const result = { first_picture_ms: await page.evaluate(() => globalThis.first), renderer };

if (what === "film") {
  await page.click("#play");
  await new Promise((done) => setTimeout(done, seconds * 1000));
  const { drawn: pictures, dropped } = await page.$eval("#time", (time) => ({ ...time.dataset }));
  Object.assign(result, { drawn: Number(pictures), dropped: Number(dropped) });
} else {
  // The page's clock in the system's monotonic one, in which the rig's exposures are told: by the fastest of some answers.
  let offset = 0, best = Infinity;
  for (let k = 0; k < 30; ++k) {
    const before = Number(process.hrtime.bigint()) / 1e6;
    const there = await page.evaluate(() => performance.now());
    const after = Number(process.hrtime.bigint()) / 1e6;
    if (after - before < best) {
      best = after - before;
      offset = (before + after) / 2 - there;
    }
  }
  // A fisheye view of 360 degrees has the horizon in its middle row: yaw by the distance from its middle.
  await page.evaluate(() => {
    const select = document.getElementById("projection");
    select.selectedIndex = 1;
    select.dispatchEvent(new Event("change"));
  });
  await page.focus("#view");
  for (let k = 0; k < 12; ++k) await page.keyboard.press("-");
  await drawn(page);
  const seen = await page.evaluate((ms) => new Promise((done) => {
    const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2"), all = [];
    const row = new Uint8Array(4 * canvas.width), end = performance.now() + ms;
    let before = -1;
    globalThis.afterFrame = () => {
      const number = Number(document.getElementById("age").dataset.number);
      const { fov } = document.getElementById("where").dataset;
      gl.readPixels(0, canvas.height >> 1, canvas.width, 1, gl.RGBA, gl.UNSIGNED_BYTE, row);
      let sum = 0, x = 0, y = 0;
      for (let k = 0; k < canvas.width; ++k) {
        const yaw = ((k + 0.5) / canvas.width - 0.5) * Number(fov);
        const bright = Math.max(0, row[4 * k] - 160);
        sum += bright;
        x += bright * Math.sin((yaw * Math.PI) / 180);
        y += bright * Math.cos((yaw * Math.PI) / 180);
      }
      const place = sum > 0 ? Math.atan2(x, y) / (2 * Math.PI) : null;
      if (place !== null && place !== before) all.push({ at: performance.now(), place, number });
      before = place;
      if (performance.now() >= end) done(all);
    };
  }), seconds * 1000);
  const kTurn = 4000; // ms
  result.ages_ms = seen.map(({ at, place }) => (((at + offset - place * kTurn) % kTurn) + kTurn) % kTurn);
}
console.log(JSON.stringify(result));
await browser.close();
