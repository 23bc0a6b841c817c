// Drives the page of `nodal look` in headless Chromium:  node look_page.mjs LINK FOLDER STEPS
// STEPS is a list as JSON; each step is a list of a name and its arguments. What "state", "axe" and "requests" find is
// printed as one JSON document a line. Pictures go into FOLDER.
import { join } from "node:path";
import { axe, browser, drawn as drawnBy, headset } from "./browser.mjs";

const [link, folder, stepsText] = process.argv.slice(2);
const page = await browser.newPage();
const requests = [], errors = [];
page.on("request", (request) => requests.push(request.url()));
page.on("console", (line) => { if (line.type() === "error") errors.push(line.text()); });
page.on("pageerror", (error) => errors.push(String(error)));

let session = null;
const devtools = async () => (session ??= await page.createCDPSession());
const print = (document) => console.log(JSON.stringify(document));
const drawn = () => drawnBy(page);
/// After the page has asked the program for a change, and drawn it.
const done = async () => {
  await drawn();
  await page.waitForFunction(() => !document.getElementById("stage").hasAttribute("aria-busy"), { timeout: 60000 });
  await drawn();
};
const box = async () => (await page.$("#view")).boundingBox();

const steps = {
  size: async (width, height) => {
    await page.setViewport({ width, height, deviceScaleFactor: 1 });
    if (page.url().startsWith("http")) await drawn(); // the page notices its new size a frame later
  },
  // What graphics there are: "none", or graphics that take pictures of no more than `largest` px.
  graphics: (kind, largest) => page.evaluateOnNewDocument((what, most) => {
    const real = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (...words) {
      if (what === "none") return null;
      const context = real.apply(this, words);
      const parameter = context?.getParameter?.bind(context);
      if (parameter) context.getParameter = (name) => (name === context.MAX_TEXTURE_SIZE ? most : parameter(name));
      return context;
    };
  }, kind, largest),
  open: async () => {
    const begin = Date.now();
    await page.goto(link, { waitUntil: "domcontentloaded" });
    await page.waitForFunction(() => document.documentElement.dataset.ready || !document.getElementById("message").hidden,
      { timeout: 60000 });
    await drawn();
    print({ opened_ms: Date.now() - begin });
  },
  select: async (id, index) => {
    await page.evaluate((name, k) => {
      const select = document.getElementById(name);
      select.selectedIndex = k;
      select.dispatchEvent(new Event("change"));
    }, id, index);
    await done();
  },
  // Pixels of the view; null: half of its height.
  drag: async (x0, y0, x1, y1) => {
    const { x, y, height } = await box();
    await page.mouse.move(x + x0, y + (y0 ?? height / 2));
    await page.mouse.down();
    await page.mouse.move(x + x1, y + (y1 ?? height / 2), { steps: 5 });
    await page.mouse.up();
    await done();
  },
  // With Shift, to the right by so many pixels.
  roll: async (x0, y0, pixels) => {
    await page.keyboard.down("Shift");
    await steps.drag(x0, y0, x0 + pixels, y0);
    await page.keyboard.up("Shift");
  },
  keys: async (name, count) => {
    for (let k = 0; k < count; ++k) await page.keyboard.press(name);
    await done();
  },
  wheel: async (pixels) => {
    const { x, y, width, height } = await box();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.wheel({ deltaY: pixels });
    await new Promise((done) => setTimeout(done, 100)); // the browser sends it later
    await drawn();
  },
  // Two fingers beside the middle go from one distance to another.
  pinch: async (from, to) => {
    const { x, y, width, height } = await box();
    const client = await page.createCDPSession();
    const touch = (type, apart) => client.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: apart === null ? [] : [-1, 1].map((sign, id) =>
        ({ id, x: x + width / 2 + (sign * apart) / 2, y: y + height / 2 })),
    });
    await touch("touchStart", from);
    await touch("touchMove", (from + to) / 2);
    await touch("touchMove", to);
    await touch("touchEnd", null);
    await drawn();
  },
  // "Shift+ArrowLeft" too.
  key: async (name) => {
    const words = name.split("+").filter((word) => word !== "");
    const last = name.endsWith("+") ? "+" : words.pop();
    for (const held of words) await page.keyboard.down(held);
    await page.keyboard.press(last);
    for (const held of words) await page.keyboard.up(held);
    await done();
  },
  // A device with a touch screen, before the page opens. `as`: an emulated headset, a page that is not secure, a user
  // who forbids motion, or one of these without a name.
  device: async (as) => {
    await (await devtools()).send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 5 });
    if (as === "headset") {
      await page.evaluateOnNewDocument(`${headset()}
        globalThis.worn = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true, fovy: Math.PI / 2 });
        globalThis.worn.ipd = 0.063;
        globalThis.worn.installRuntime({ forceInstall: true });`);
    }
    await page.evaluateOnNewDocument((what) => {
      if (what === "insecure") Object.defineProperty(globalThis, "isSecureContext", { value: false });
      if (what === "refusing") DeviceOrientationEvent.requestPermission = async () => "denied";
    }, as);
  },
  // How the device is turned, as its DeviceOrientationEvents say it, and how the page is turned on it.
  orient: async (alpha, beta, gamma, screen = 0) => {
    const { width, height } = page.viewport();
    await (await devtools()).send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: false,
      screenOrientation: { type: screen === 0 ? "portraitPrimary" : "landscapePrimary", angle: screen } });
    await (await devtools()).send("DeviceOrientation.setDeviceOrientationOverride", { alpha, beta, gamma });
    await new Promise((done) => setTimeout(done, 200)); // the event comes later
    await drawn();
  },
  // Where the headset is and looks: metres, and a quaternion x, y, z, w.
  wear: async (position, quaternion) => {
    await page.evaluate((at, turn) => {
      globalThis.worn.position.set(...at);
      globalThis.worn.quaternion.set(...turn);
      const canvas = document.getElementById("view"); // where the emulation shows both eyes
      Object.assign(canvas.style, { left: 0, top: 0, width: "100%", height: "100%" });
    }, position, quaternion);
    await new Promise((done) => setTimeout(done, 1000)); // some frames of the session
    await drawn();
  },
  // Ends the session of the emulated headset.
  session: async () => {
    await page.evaluate(() => globalThis.worn.activeSession.end());
    await drawn();
  },
  shown: async (selector) => print(await page.$eval(selector, (each) => each.checkVisibility())),
  wait: (ms) => new Promise((done) => setTimeout(done, ms)),
  loseGraphics: async () => {
    await page.evaluate(() => document.getElementById("view").getContext("webgl2").getExtension("WEBGL_lose_context").loseContext());
    await page.waitForSelector("#flat:not([hidden])");
    await drawn();
  },
  shot: async (name, selector) => {
    await drawn();
    if (selector === "page") await page.screenshot({ path: join(folder, name) });
    else await (await page.$(selector ?? "#view")).screenshot({ path: join(folder, name) });
  },
  state: async () => print(await page.evaluate(() => {
    const text = (id) => document.getElementById(id)?.textContent ?? "";
    const { yaw, pitch, roll, fov } = document.getElementById("where").dataset;
    const view = document.getElementById("view").getBoundingClientRect();
    return {
      yaw: Number(yaw), pitch: Number(pitch), roll: Number(roll), fov: Number(fov), width: view.width, height: view.height,
      command: text("command"), message: document.getElementById("message").hidden ? "" : text("message"),
      notes: text("notes"), path: text("path"), age: text("age"), title: document.title, focus: document.activeElement.id,
      flat: document.getElementById("flat")?.hidden !== false ? 0 : document.getElementById("flat").naturalWidth,
      wider: document.documentElement.scrollWidth - innerWidth,
    };
  })),
  axe: async () => {
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => globalThis.axe.run());
    print(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`));
  },
  // A control of the page.
  press: async (selector) => {
    await page.click(selector);
    await drawn();
  },
  click: async (x0, y0) => {
    const { x, y } = await box();
    await page.mouse.click(x + x0, y + y0);
    await done();
  },
  // What the program says of heads that are placed by hand.
  heads: async () => print(await page.evaluate(async () => (await fetch("state.json")).json())),
  // Until the page shows a text.
  until: (text) => page.waitForFunction((wanted) => document.body.textContent.includes(wanted), { timeout: 120000 }, text),
  // Plays a film for some time; which picture is shown then, and how many were shown and left out.
  play: async (seconds) => {
    await page.click("#play");
    await new Promise((done) => setTimeout(done, seconds * 1000));
    const { shown, drawn: pictures, dropped } = await page.$eval("#time", (time) => ({ ...time.dataset }));
    if (await page.$eval("#play", (button) => button.textContent === "Pause")) await page.click("#play");
    print({ shown: Number(shown), drawn: Number(pictures), dropped: Number(dropped) });
  },
  film: async () => print(await page.$eval("#time", (time) => ({ shown: Number(time.dataset.shown), text: time.textContent }))),
  details: () => page.click("summary"),
  requests: () => print({ requests, errors }),
};

try {
  for (const [name, ...words] of JSON.parse(stepsText)) await steps[name](...words);
} finally {
  await browser.close();
}
