// Starts a browser without a screen, and what the tests of pages run in it: headless Chromium, whose WebGL is drawn by
// SwiftShader; with NODAL_BROWSER=firefox, Firefox on an X server of its own (headless, it has no WebGL), drawn by llvmpipe.
import { createRequire } from "node:module";
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";

const modules = join(import.meta.dirname, "../../build/browser/node_modules/");
const puppeteer = createRequire(modules)("puppeteer-core");

/// Sources of axe-core and of iwer, an emulated headset: to be evaluated in a page.
export const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf8");
export const headset = () => readFileSync(join(modules, "iwer/build/iwer.min.js"), "utf8");

async function startFirefox() {
  const screen = spawn("Xvfb", ["-displayfd", "3", "-screen", "0", "1600x1200x24", "-nolisten", "tcp"],
    { stdio: ["ignore", "ignore", "ignore", "pipe"] });
  const display = await new Promise((done, failed) => {
    screen.stdio[3].once("data", (bytes) => done(bytes.toString().trim()));
    screen.once("error", failed);
  });
  const firefox = await puppeteer.launch({
    browser: "firefox", executablePath: "/usr/bin/firefox-esr", headless: false, acceptInsecureCerts: true,
    env: { ...process.env, DISPLAY: `:${display}`, MOZ_ENABLE_WAYLAND: "0" },
    extraPrefsFirefox: { "webgl.force-enabled": true },
  });
  const close = firefox.close.bind(firefox);
  firefox.close = async () => { await close(); screen.kill(); };
  return firefox;
}

export const browser = process.env.NODAL_BROWSER === "firefox" ? await startFirefox() : await puppeteer.launch({
  executablePath: "/usr/bin/chromium",
  acceptInsecureCerts: true, // the front of a rig's page signs its own certificate
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"],
});

/// After the page has drawn what it was asked for.
export const drawn = (page) => page.evaluate(() => new Promise((done) =>
  requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 0)))));
