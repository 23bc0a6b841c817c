// Drives the page of a rig in headless Chromium:  node rig_page.mjs SOCKET FOLDER KEY CERTIFICATE OPERATE_CODE WATCH_CODE
// A TLS server in this program stands in front of nodal-web's SOCKET; it passes every answer on in pieces of random
// lengths. What each step found is printed as one JSON document a line. Before "lost" it waits for the rig to end, after
// it for the rig to come back. Pictures go into FOLDER.
import { createServer } from "node:https";
import { readFileSync } from "node:fs";
import { request } from "node:http";
import { join } from "node:path";
import { axe, browser, drawn } from "./browser.mjs";

const [socket, folder, key, certificate, operateCode, watchCode] = process.argv.slice(2);
const print = (document) => console.log(JSON.stringify(document));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

// What the rig is made to say: a head without its cable, heads out of step.
let change = null;
const changed = (text) => {
  const state = JSON.parse(text);
  change(state);
  return JSON.stringify(state);
};

const front = createServer({ key: readFileSync(key), cert: readFileSync(certificate) }, (asked, answer) => {
  const onwards = request({ socketPath: socket, path: asked.url, method: asked.method,
    headers: { ...asked.headers, "x-server-addr": "127.0.0.1" } }, (from) => {
    if (change && asked.url === "/api/state" && from.statusCode === 200) {
      const all = [];
      from.on("data", (bytes) => all.push(bytes));
      from.on("end", () => answer.end(changed(Buffer.concat(all).toString())));
      return;
    }
    answer.writeHead(from.statusCode, from.headers);
    from.on("data", (bytes) => {
      for (let k = 0; k < bytes.length;) {
        const next = k + 1 + Math.floor(Math.random() * 5000);
        answer.write(bytes.subarray(k, next));
        k = next;
      }
    });
    from.on("end", () => answer.end());
    from.on("error", () => answer.destroy());
  });
  onwards.on("error", () => { answer.writeHead(502); answer.end("no answer"); });
  answer.on("close", () => onwards.destroy());
  asked.pipe(onwards);
});
await new Promise((done) => front.listen(0, "127.0.0.1", done));
const site = `https://127.0.0.1:${front.address().port}/`;

const requests = [], errors = [];
async function open(code, context) {
  const page = await context.newPage();
  page.on("request", (sent) => requests.push(sent.url()));
  page.on("pageerror", (error) => errors.push(String(error)));
  await page.setViewport({ width: 1280, height: 900 });
  await page.goto(`${site}pair#${code}`);
  await page.waitForSelector("#pair");
  const codeStays = page.url().includes(code);
  await page.focus("#name");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => Number(document.getElementById("age")?.dataset.pictures) >= 3, { timeout: 60000 });
  await page.waitForFunction(() => document.getElementById("heads").children.length > 0);
  await drawn(page);
  return { page, codeStays };
}
const violations = async (page) => {
  await page.evaluate(axe);
  const found = await page.evaluate(() => globalThis.axe.run());
  return found.violations.map(({ id, nodes }) => `${id}: ${nodes[0].html.slice(0, 120)}`);
};
const shot = (page, name) => page.screenshot({ path: join(folder, `${name}.png`) });
const takeOf = (page) => page.evaluate(async () => (await (await fetch("api/state")).json()).status.recording.take);
const recording = (page, on) => page.waitForFunction((want) =>
  document.getElementById("record").classList.contains("recording") === want &&
  !document.getElementById("record").disabled, { timeout: 15000 }, on);

const { page, codeStays } = await open(operateCode, await browser.createBrowserContext());
await shot(page, "open");
print({ step: "open", code_stays: codeStays, name: await page.$eval("#name", (each) => each.textContent),
  age_ms: await page.$eval("#age", (each) => Number(each.dataset.age)), axe: await violations(page) });

// The button is pressed twice at once: the second press is none. Later it ends the take.
await page.evaluate(() => { const button = document.getElementById("record"); button.click(); button.click(); });
await recording(page, true);
const begun = await takeOf(page);
await sleep(700);
await shot(page, "recording");
await page.click("#record");
await recording(page, false);
await page.waitForFunction(() => {
  const files = document.querySelector("#takes details");
  if (files) files.open = true;
  return files?.querySelector("a[href$='cam0-0000.mkv']");
}, { timeout: 20000 });
const downloaded = await page.evaluate(async () => {
  const bytes = await (await fetch(document.querySelector("#takes a[href$='cam0-0000.mkv']").href)).arrayBuffer();
  const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return [...hash].map((byte) => byte.toString(16).padStart(2, "0")).join("");
});
print({ step: "recorded", begun, ended: await takeOf(page), takes: await page.$$eval("#takes > li", (all) => all.length),
  sha256: downloaded, axe: await violations(page) });

// Keys only: every control is reached, and the record button works.
const reached = new Set();
await page.evaluate(() => document.activeElement.blur());
for (let k = 0; k < 40; ++k) {
  await page.keyboard.press("Tab");
  const id = await page.evaluate(() => document.activeElement.id || document.activeElement.tagName.toLowerCase());
  reached.add(id);
  if (id === "view") {
    const before = await page.$eval("#stage", (each) => Number(each.dataset.yaw));
    await page.keyboard.press("ArrowRight");
    await drawn(page);
    reached.add(`turned ${(await page.$eval("#stage", (each) => Number(each.dataset.yaw))) - before}`);
  }
  if (id === "record") {
    await page.keyboard.press("Enter");
    await recording(page, true);
    await page.focus("#record"); // a disabled button has no focus
    await page.keyboard.press("Space");
    await recording(page, false);
    await page.focus("#record");
  }
}
print({ step: "keys", reached: [...reached] });

/// The texts of a head's row, and which of them are marked as bad.
const row = (name) => page.evaluate((head) => {
  const rows = [...document.getElementById("heads").children];
  const cells = [...rows.find((each) => each.cells[0].textContent.startsWith(head)).cells];
  return { cells: cells.map((each) => each.textContent), bad: cells.map((each) => each.className) };
}, name);
const showChart = () => page.$eval("#heads-title", (each) => each.scrollIntoView());
const order = (path, document) => page.evaluate(async (where, json) => (await fetch(where, { method: "POST",
  headers: { "Content-Type": "application/json" }, body: json })).status, path, JSON.stringify(document));
// The heads fall out of step for some questions, and cam2 loses its cable.
change = (state) => { state.status.genlock.state = "locked"; state.status.genlock.spread_ns = 1500000;
  Object.assign(state.heads.find((each) => each.name === "cam2"), { present: false }); };
await page.waitForFunction(() => Number(document.getElementById("skew").dataset.over) >= 3, { timeout: 20000 });
const line = (id) => page.$eval(`#skew ${id}`, (each) => each.getAttribute(each.tagName === "line" ? "y1" : "d"));
await showChart();
await shot(page, "skew");
print({ step: "skew", words: await page.$eval("#apart", (each) => each.textContent),
  limit: Number(await line("line")), newest: Number((await line("path")).split(" ").pop()),
  bad: await page.$eval("#skew", (each) => each.classList.contains("bad")),
  unplugged: await row("cam2"), others: await row("cam1"), axe: await violations(page) });
change = null;
await page.waitForFunction(() => !document.getElementById("skew").classList.contains("bad"), { timeout: 20000 });

// One head gets too much light from here on; the other heads' settings stay.
print({ step: "overexpose", manual: await order("api/exposure", { program: "manual" }),
  set: await order("api/heads", { heads: [3], exposure_ns: 30000000, gain_mdb: 12000 }) });
await page.waitForFunction(() => [...document.getElementById("heads").children].some((each) =>
  each.cells[0].textContent === "cam3" && parseFloat(each.cells[2].textContent) > 10), { timeout: 20000 });
await sleep(2500);
await shot(page, "overexposed");
print({ step: "overexposed", heads: await Promise.all([0, 1, 2, 3, 4, 5].map((k) => row(`cam${k}`))) });

await page.setViewport({ width: 320, height: 640 });
await drawn(page);
await showChart();
await shot(page, "narrow-chart");
await page.evaluate(() => scrollTo(0, 0));
await shot(page, "narrow");
print({ step: "narrow", wide: await page.evaluate(() => document.documentElement.scrollWidth),
  axe: await violations(page),
  beside: await page.$$eval("header *, section > *, section .row > *, #stage > *", (all) => all
    .filter((each) => { const { right, width } = each.getBoundingClientRect(); return width > 0 && right > 320.5; })
    .map((each) => each.id || each.outerHTML.slice(0, 60))) });
await page.setViewport({ width: 1280, height: 900 });

// A phone at the edge of the network: 30 kB/s, and a processor that is six times slower.
const devtools = await page.createCDPSession();
await devtools.send("Network.emulateNetworkConditions",
  { offline: false, latency: 50, downloadThroughput: 30000, uploadThroughput: 30000 });
await devtools.send("Emulation.setCPUThrottlingRate", { rate: 6 });
await sleep(4000);
const ages = [], picturesBefore = await page.$eval("#age", (each) => Number(each.dataset.pictures));
for (let k = 0; k < 40; ++k) {
  ages.push(await page.$eval("#age", (each) => Number(each.dataset.age)));
  await sleep(400);
}
print({ step: "slow", ages,
  pictures: (await page.$eval("#age", (each) => Number(each.dataset.pictures))) - picturesBefore });
await devtools.send("Network.emulateNetworkConditions",
  { offline: false, latency: 0, downloadThroughput: -1, uploadThroughput: -1 });
await devtools.send("Emulation.setCPUThrottlingRate", { rate: 1 });
await devtools.detach();

const hide = (hidden) => page.evaluate((value) => {
  Object.defineProperty(document, "hidden", { value, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}, hidden);
await hide(true);
await sleep(1500); // questions on their way are answered within a second
const before = requests.length;
await sleep(2000);
const whileHidden = requests.length - before;
print({ step: "hidden", requests: whileHidden });

// While the operator's page is hidden: two pages that draw in software take long.
const guest = (await open(watchCode, await browser.createBrowserContext())).page;
await shot(guest, "watch");
print({ step: "watch", enabled: await guest.$$eval("button, select, input", (all) => all
  .filter((each) => !each.disabled).map((each) => each.id || each.textContent)),
  files: await guest.$$eval("#takes details", (all) => all.length),
  refused: await guest.evaluate(async () => (await fetch("api/record", { method: "POST",
    headers: { "Content-Type": "application/json" }, body: "{\"on\": true}" })).status) });
await guest.close();
await hide(false);
const shown = await page.$eval("#age", (each) => Number(each.dataset.pictures));
await page.waitForFunction((k) => Number(document.getElementById("age").dataset.pictures) > k + 2, {}, shown);
print({ step: "lose" });
await page.waitForFunction(() => document.documentElement.dataset.gone &&
  document.getElementById("stage").classList.contains("old"), { timeout: 30000 });
await shot(page, "gone");
print({ step: "lost", says: await page.$eval("#message", (each) => each.textContent),
  state: await page.$eval("#state", (each) => each.textContent),
  enabled: await page.$$eval("section .row button", (all) => all.filter((each) => !each.disabled).map((each) => each.id)) });
await page.waitForFunction(() => !document.documentElement.dataset.gone &&
  !document.getElementById("stage").classList.contains("old"), { timeout: 40000 });
await drawn(page);
await shot(page, "back");
print({ step: "back", says: await page.$eval("#message", (each) => (each.hidden ? "" : each.textContent)),
  foreign: requests.filter((url) => !url.startsWith(site) && !url.startsWith("blob:") && !url.startsWith("data:")),
  errors });
await browser.close();
front.closeAllConnections();
front.close();
