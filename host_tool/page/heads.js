// The page of heads that are placed by hand: every change is a request to the program, whose state is then shown.

import { Camera } from "./camera.js";
import { connectFilm } from "./film_controls.js";
import { connectTrial } from "./heads_trial.js";
import { HeadsView, kColours } from "./heads_view.js";
import { listen } from "./input.js";
import { Stage, ask, at, listed, picture, read, say, stayConnected } from "./stage.js";
import { between, turnedAxes } from "./turns.js";

const camera = new Camera();
const stage = new Stage(camera, () => stage.tell(at("where")));
const { canvas, changed } = stage;
const message = at("message");
const kPoll = 300; // ms, while a registration or a trial runs
const kLargest = 2048; // px, of a head's picture: enough to place it
const kArrow = Math.PI / 1800; // 0.1 degrees
const kRoll = Math.PI / 900; // by px
const kSamePlace = 12; // px, between a click and the first corner of a mask that it closes
let view = null, scene = null, state = null, filmKeys = {};
let set = 0; // of a take: the one that is shown
let slide = null; // a drag of heads: where it began, and the rotation since
let pair = null; // the first click of a pair
let points = []; // of the horizon, of a vertical line, or corners of a mask
let clicking = false, polling = false, showTrial = () => false;

function colourOf(one) {
  if (one.outlier) return "#ff00ff";
  return one.residual_deg < 0.1 ? "#00e676" : one.residual_deg < 0.5 ? "#ffea00" : "#ff3d00";
}

/// Shows what the program says.
function take(made) {
  state = made;
  state.heads.forEach((head, k) => view.turnHead(k, head.axes));
  view.setPairs(state.pairs.filter((one) => one.ray_a)
    .map((one) => ({ a: one.ray_a, b: one.ray_b, colour: colourOf(one) })));
  showMasks();
  at("undo").disabled = !state.undo;
  at("redo").disabled = !state.redo;
  const name = (k) => scene.heads[k].name, deg = (value) => `${value.toFixed(3)}°`;
  const outliers = state.pairs.filter((one) => one.outlier).length;
  listed("agreements", [
    ...state.agreements.map((one) => `${name(one.a)} and ${name(one.b)}: ${one.pairs} pairs, ` +
      `${deg(one.rms_deg)} rms, ${deg(one.worst_deg)} worst`),
    ...(outliers > 0 ? [`${outliers} pairs contradict the others`] : []),
  ]);
  const running = state.registering !== null;
  at("progress").hidden = !running;
  at("progress").value = state.registering ?? 0;
  for (const id of ["register", "fit"]) at(id).disabled = running;
  const { registered } = state;
  if (registered && !registered.error) {
    const { levels_before: before, levels_after: after, heads, warnings } = registered;
    const turned = (head) => `${head.name} turned by ${deg(head.turned_deg)}, ± ${deg(head.sigma_deg ?? 0)}`;
    listed("changes", [
      `where heads overlap, they differ by ${after.toFixed(2)} levels of 255; before, by ${before.toFixed(2)}`,
      ...heads.map((head) => (head.placed ? turned(head) : `${head.name}: ${head.why_not}`)), ...warnings,
    ]);
  }
  if (showTrial(state.trial) || running) pollLater();
  document.documentElement.dataset.revision = state.revision;
  changed();
}

/// One question at a time, however many changes there are meanwhile.
function pollLater() {
  if (polling) return;
  polling = true;
  setTimeout(() => { polling = false; poll().catch((error) => say(error.message)); }, kPoll);
}

async function poll() {
  if (slide) return pollLater(); // what is dragged stays under the pointer
  const before = state.registering;
  take(await read("state.json"));
  if (before === null || state.registering !== null) return;
  say(state.registered?.error || "Registered; what changed is below.");
  at("about").open = true;
  return undefined;
}

/// Asks for a change. Gives whether it was made.
async function change(what, words = {}) {
  stage.box.setAttribute("aria-busy", "true");
  try {
    const body = JSON.stringify({ revision: state.revision, do: what, ...words });
    take(await (await ask("change", { method: "POST", headers: { "Content-Type": "application/json" }, body })).json());
    return true;
  } catch (error) {
    if (error.status === 409) take(await read("state.json"));
    else state.heads.forEach((head, k) => view.turnHead(k, head.axes));
    say(error.message);
    changed();
    return false;
  } finally {
    stage.box.removeAttribute("aria-busy");
  }
}

async function save() {
  say("");
  if (await change("save")) return say(`Saved as ${state.saved}.`);
  if (!/exist|there already/.test(message.textContent)) return;
  at("question").textContent = message.textContent;
  at("ask").showModal();
}

function choose(k, on) {
  if (on) view.chosen.add(k);
  else view.chosen.delete(k);
  at(`head${k}`).checked = on;
  changed();
}

const place = (event) => {
  const box = canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};
const query = (values) => new URLSearchParams(values).toString();
const seenAt = ([x, y, z]) => read(`seen?${query({ x, y, z })}`);

async function clickPair(direction) {
  const seen = (await seenAt(direction)).sort((a, b) => b.edge_px - a.edge_px);
  if (!pair) {
    const first = seen.find((one) => view.chosen.has(one.head)) ?? seen[0];
    if (!first) return say("No head shows this place.");
    const other = seen.find((one) => one.head !== first.head);
    pair = { a: first.head, x: first.x, y: first.y };
    if (!other) return say(`Now click the same place in another head than ${scene.heads[pair.a].name}.`);
    return finishPair(other.head, null);
  }
  const second = seen.find((one) => one.head === pair.b) ?? seen.find((one) => one.head !== pair.a);
  if (!second) return say("No other head shows this place.");
  return finishPair(second.head, second);
}

async function finishPair(b, click) {
  const { a, x, y } = pair;
  const found = await read(`proposal?${query({ a, x, y, b, set, ...(click ? { bx: click.x, by: click.y } : {}) })}`);
  if (!found.found && !click) {
    pair.b = b;
    return say(`${found.why} Click it in ${scene.heads[b].name}.`);
  }
  pair = null;
  const to = found.found ? found : click;
  if (await change("add_pair", { a, x, y, b, bx: to.x, by: to.y })) {
    say(found.found ? `A pair of ${scene.heads[a].name} and ${scene.heads[b].name}; the two places look alike by ` +
      `${Math.round(100 * found.correlation)} %.` : "The pair is where you clicked; the places do not look alike.");
  }
}

async function mark(direction, tool) {
  points.push(direction);
  const wanted = tool === "horizon" ? 2 : 3;
  if (points.length < wanted) return say(`${wanted - points.length} more to click.`);
  const done = await change(tool === "horizon" ? "level" : "upright", { points });
  points = [];
  if (done) say("The rig is level now.");
}

/// Draws a mask of the chosen head, corner by corner.
async function clickMask(direction, event) {
  if (view.chosen.size !== 1) return say("Choose one head below; the mask is drawn on it.");
  const first = points.length > 2 ? camera.pixelOf(points[0]) : null;
  const [x, y] = place(event);
  if (first && Math.hypot(first[0] - x, first[1] - y) < kSamePlace) return closeMask();
  points.push(direction);
  showMasks();
  say(points.length < 3 ? `${3 - points.length} more to click.` : "Click the first corner again, or press Enter.");
}

async function closeMask() {
  if (at("tool").value !== "mask" || points.length < 3) return;
  const [head] = view.chosen, corners = points;
  points = [];
  if (await change("mask", { head, points: corners })) say(`Head ${scene.heads[head].name} is not used inside the mask.`);
  else showMasks();
}

function showMasks() {
  const closed = state.heads.flatMap((head) => head.masks.map((outline) => [...outline, outline[0]]));
  view.setOutlines(at("tool").value === "mask" ? [...closed, points] : closed);
  changed();
}

/// One click after the other: what a click means depends on what the one before has found.
async function click(tool, from, event) {
  if (clicking) return;
  clicking = true;
  stage.box.setAttribute("aria-busy", "true");
  try {
    if (tool === "pair") await clickPair(from);
    else if (tool === "mask") await clickMask(from, event);
    else await mark(from, tool);
  } finally {
    clicking = false;
    stage.box.removeAttribute("aria-busy");
  }
}

async function press(event) {
  const tool = at("tool").value;
  if (tool === "look" || event.button !== 0) return;
  event.stopImmediatePropagation();
  canvas.setPointerCapture(event.pointerId);
  const from = camera.grab(...place(event));
  if (!from) return;
  try {
    if (tool !== "slide") return await click(tool, from, event);
    slide = { from, x: event.clientX, about: [0, 0, 0], last: event };
    if (view.chosen.size === 0) {
      const [top] = (await seenAt(from)).sort((a, b) => b.edge_px - a.edge_px);
      if (top) choose(top.head, true);
    }
    if (slide) move(slide.last);
  } catch (error) {
    say(error.message);
  }
}

function move(event) {
  if (!slide) return;
  event.stopImmediatePropagation?.();
  slide.last = event;
  const to = camera.grab(...place(event));
  if (!to) return;
  slide.about = event.shiftKey ? slide.from.map((v) => v * (event.clientX - slide.x) * kRoll) : between(slide.from, to);
  for (const k of view.chosen) view.turnHead(k, turnedAxes(slide.about, state.heads[k].axes));
  changed();
}

async function release() {
  if (!slide) return;
  const { about } = slide;
  slide = null;
  if (view.chosen.size > 0 && Math.hypot(...about) > 0) await change("turn", { heads: [...view.chosen], about });
}

function arrows(event) {
  const steps = { ArrowLeft: [0, 1, 0], ArrowRight: [0, -1, 0], ArrowUp: [1, 0, 0], ArrowDown: [-1, 0, 0] };
  const step = steps[event.key];
  if (!step || at("tool").value !== "slide" || view.chosen.size === 0) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  // About the axes of the view: x to the right, y up.
  const yaw = (-camera.yaw * Math.PI) / 180;
  const about = step[1] ? [0, step[1], 0] : [Math.cos(yaw) * step[0], 0, -Math.sin(yaw) * step[0]];
  change("turn", { heads: [...view.chosen], about: about.map((v) => v * kArrow) });
}

function forget() {
  pair = null;
  points = [];
  showMasks();
  say("");
}

function connect() {
  canvas.addEventListener("pointerdown", press);
  canvas.addEventListener("pointermove", move);
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, release);
  canvas.addEventListener("keydown", arrows);
  listen(canvas, camera, changed, {
    ...filmKeys, Home: () => camera.reset(), z: () => change("undo"), y: () => change("redo"),
    Escape: forget, Enter: closeMask,
  });
  at("tool").addEventListener("change", forget);
  at("unmask").addEventListener("click", () => {
    if (view.chosen.size !== 1) return say("Choose one head below; its masks are removed.");
    const [head] = view.chosen;
    change("unmask", { head });
  });
  at("mode").addEventListener("change", () => { view.mode = at("mode").value; changed(); });
  at("projection").addEventListener("change", () => { camera.look("inside", at("projection").value); changed(); });
  for (const what of ["undo", "redo", "fit"]) at(what).addEventListener("click", () => change(what));
  at("register").addEventListener("click", () => change("register", { free: at("free").value, set }));
  at("save").addEventListener("click", save);
  at("no").addEventListener("click", () => at("ask").close());
  at("yes").addEventListener("click", async () => {
    at("ask").close();
    if (await change("save", { replace: true })) say(`Saved as ${state.saved}.`);
  });
  addEventListener("focus", async () => { if (!slide) take(await read("state.json")); });
  stayConnected();
}

function addChoice({ name }, k) {
  const label = document.createElement("label"), box = document.createElement("input");
  Object.assign(box, { type: "checkbox", id: `head${k}` });
  box.addEventListener("change", () => choose(k, box.checked));
  label.append(box, ` ${name}`);
  label.style.borderLeft = `.4rem solid ${kColours[k % kColours.length]}`;
  at("heads").append(label);
}

/// All heads' pictures of a set of a take.
async function loadSet(k) {
  const side = Math.min(kLargest, view.largestPicture);
  const pictures = await Promise.all(scene.heads.map((head, n) => picture(`head?head=${n}&side=${side}&set=${k}`)));
  return { k, pictures, close: () => pictures.forEach((each) => each.close()) };
}

function showSet({ k, pictures }) {
  set = k;
  pictures.forEach((each, n) => view.setHeadPicture(n, each));
  changed();
}

async function start() {
  scene = await read("scene.json");
  document.title = `${scene.name} – nodal look`;
  at("name").textContent = scene.name;
  at("size").textContent = `${scene.heads.length} heads; Save writes ${scene.out}`;
  listed("notes", scene.notes);
  if (!stage.begin(HeadsView)) return say("This browser has no WebGL, which draws the heads.");
  ({ view } = stage);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    say("This computer's graphics stopped (WebGL was lost). Nothing is lost: reload the page.");
  });
  const side = Math.min(kLargest, view.largestPicture);
  for (let k = 0; k < scene.heads.length; ++k) {
    const [grid, bitmap] = await Promise.all([ask(`grid.glb?head=${k}`), picture(`head?head=${k}&side=${side}`)]);
    await view.addHead(await grid.arrayBuffer(), bitmap);
    addChoice(scene.heads[k], k);
  }
  showTrial = connectTrial(scene.rig, change);
  if (scene.pictures > 1) filmKeys = await connectFilm(loadSet, showSet);
  take(await read("state.json"));
  connect();
  stage.resize();
  document.documentElement.dataset.ready = "1";
}

start().catch((error) => say(error.message));
