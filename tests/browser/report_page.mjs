// Opens the report of `nodal stitch` in headless Chromium:  node report_page.mjs PAGE FOLDER WIDTH…
// For each width of the window, prints as one JSON document: how far the page is wider than the window, axe-core's
// violations (all details open), whether the sphere turns when it is dragged, and the pictures that the page shows.
// Pictures of the page go into FOLDER.
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { axe, browser, drawn as drawnBy } from "./browser.mjs";

const [file, folder, ...widths] = process.argv.slice(2);

async function look(width, scheme) {
  const page = await browser.newPage();
  const errors = [], requests = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (line) => { if (line.type() === "error") errors.push(line.text()); });
  page.on("request", (request) => requests.push(request.url().split(",")[0]));
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.setViewport({ width, height: 900, deviceScaleFactor: 1 });
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("figure.sphere[data-ready] canvas", { timeout: 60000 });
  const drawn = () => drawnBy(page);
  const canvas = await page.$("figure.sphere canvas");
  const shot = async (name) => {
    await drawn();
    return Buffer.from(await canvas.screenshot(name ? { path: join(folder, name) } : {}));
  };
  await canvas.focus(); // its frame is in every picture
  const before = await shot(`${width}-${scheme}-sphere.png`);
  const { x, y, width: wide, height } = await canvas.boundingBox();
  await page.mouse.move(x + wide / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(x + wide / 4, y + height / 2, { steps: 5 });
  await page.mouse.up();
  const dragged = await shot(`${width}-${scheme}-dragged.png`);
  await page.keyboard.press("Home");
  const home = await shot();
  await page.evaluate(() => {
    document.activeElement.blur();
    for (const details of document.querySelectorAll("details")) details.open = true;
  });
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  const shown = await page.evaluate(() => ({
    wider: document.documentElement.scrollWidth - innerWidth,
    beside: [...document.querySelectorAll("body *")]
      .filter((one) => !one.closest("div.table, svg *") && one.getBoundingClientRect().right > innerWidth + 1)
      .map((one) => one.outerHTML.slice(0, 80)),
    crops: [...document.querySelectorAll("figure:not(.sphere) img")].filter((image) => !image.closest("details"))
      .map((image) => image.naturalWidth),
    title: document.title,
  }));
  await page.screenshot({ path: join(folder, `${width}-${scheme}-page.png`), fullPage: true });
  await page.close();
  return { width, scheme, ...shown, errors, requests, turned: !before.equals(dragged), back: before.equals(home),
    axe: violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html.slice(0, 120)).join(" ")}`) };
}

try {
  for (const width of widths) {
    for (const scheme of ["light", "dark"]) console.log(JSON.stringify(await look(Number(width), scheme)));
  }
} finally {
  await browser.close();
}
