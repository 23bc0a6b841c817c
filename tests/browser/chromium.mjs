// Headless Chromium whose WebGL is drawn by SwiftShader, and what the tests of pages run in it.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { join } from "node:path";

const modules = join(import.meta.dirname, "../../build/browser/node_modules/");
const puppeteer = createRequire(modules)("puppeteer-core");

/// axe-core's source, to be evaluated in a page.
export const axe = readFileSync(join(modules, "axe-core/axe.min.js"), "utf8");

export const browser = await puppeteer.launch({
  executablePath: "/usr/bin/chromium",
  acceptInsecureCerts: true, // the front of a rig's page signs its own certificate
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"],
});

/// After the page has drawn what it was asked for.
export const drawn = (page) => page.evaluate(() => new Promise((done) =>
  requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 0)))));
