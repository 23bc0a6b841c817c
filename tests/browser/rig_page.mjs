// Drives the page of a rig in headless Chromium:  node rig_page.mjs SOCKET FOLDER KEY CERTIFICATE OPERATE_CODE WATCH_CODE
// A TLS server in this program stands in front of nodal-web's SOCKET; it passes every answer on in pieces of random
// lengths. What each step found is printed as one JSON document a line. Before "lost" it waits for the rig to end, after
// it for the rig to come back. Pictures go into FOLDER.
import { createServer } from "node:https";
import { readFileSync } from "node:fs";
import { request } from "node:http";
import { join } from "node:path";
import { axe, browser, drawn } from "./chromium.mjs";

const [socket, folder, key, certificate, operateCode, watchCode] = process.argv.slice(2);
const print = (document) => console.log(JSON.stringify(document));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

const front = createServer({ key: readFileSync(key), cert: readFileSync(certificate) }, (asked, answer) => {
  const onwards = request({ socketPath: socket, path: asked.url, method: asked.method,
    headers: { ...asked.headers, "x-server-addr": "127.0.0.1" } }, (from) => {
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

await page.setViewport({ width: 320, height: 640 });
await drawn(page);
await shot(page, "narrow");
print({ step: "narrow", wide: await page.evaluate(() => document.documentElement.scrollWidth),
  axe: await violations(page),
  beside: await page.$$eval("header *, section > *, section .row > *, #stage > *", (all) => all
    .filter((each) => { const { right, width } = each.getBoundingClientRect(); return width > 0 && right > 320.5; })
    .map((each) => each.id || each.outerHTML.slice(0, 60))) });
await page.setViewport({ width: 1280, height: 900 });

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
