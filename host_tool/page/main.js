// The page: asks the program what is shown, and connects the camera, the drawing and the controls.

import { Camera, eyeWords } from "./camera.js";
import { connectFilm } from "./film_controls.js";
import { kKeyZoom, listen } from "./input.js";
import { watchRig } from "./live.js";
import { connectPath } from "./path.js";
import { SphereView } from "./sphere_view.js";

const at = (id) => document.getElementById(id);
const canvas = at("view"), stage = at("stage"), message = at("message"), flat = at("flat");
const camera = new Camera();
const kStepOfEye = 0.05; // by key, of the envelope's radius
let view = null, scene = null, waiting = false, filmKeys = {};

function say(text) {
  message.textContent = text;
  message.hidden = !text;
}

/// The answer, or an error whose message is the program's sentence.
async function ask(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(await answer.text());
  return answer;
}

/// Shows the picture flat, and says why.
function showFlat(why) {
  flat.src = `picture?side=${Math.min(4096, Math.max(scene.picture_width, scene.picture_height))}`;
  flat.hidden = false;
  canvas.hidden = true;
  at("tools").hidden = at("about").hidden = true;
  say(why);
}

function show() {
  waiting = false;
  if (!view || canvas.hidden) return;
  view.draw(camera);
  const degrees = (value) => `${(Math.round(value * 10) / 10).toFixed(1)}°`;
  at("where").textContent = `yaw ${degrees(camera.yaw)}, pitch ${degrees(camera.pitch)}, ${degrees(camera.fov)} wide`;
  Object.assign(at("where").dataset, { yaw: camera.yaw, pitch: camera.pitch, fov: camera.fov });
  if (scene.pictures > 1) return;
  at("command").textContent = isLoose() ? "nodal view has no soup of triangles; choose another shape"
    : camera.command(scene, scene.envelopes[at("envelope").selectedIndex], view.radius);
}

function changed() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(show);
}

function resize() {
  // Whole pixels, at whole pixels of the window: otherwise the browser would blur what is drawn.
  const { left, top, right, bottom } = stage.getBoundingClientRect();
  const width = Math.max(1, Math.floor(right) - Math.ceil(left));
  const height = Math.max(1, Math.floor(bottom) - Math.ceil(top));
  canvas.style.left = `${Math.ceil(left) - left}px`;
  canvas.style.top = `${Math.ceil(top) - top}px`;
  camera.resize(width, height);
  view?.resize(width, height);
  changed();
}

function look() {
  camera.look(at("side").value, at("projection").value);
  changed();
}

/// Whether the triangles of the first envelope are shown, each at a distance of its own.
const isLoose = () => at("envelope").selectedIndex === scene.envelopes.length;

/// Moves the eye inside, or says why it cannot be there: an opaque envelope must be seen from its inner side only.
async function moveEye(eye) {
  const moved = eye.some((value) => value !== 0);
  stage.setAttribute("aria-busy", "true");
  try {
    if (moved && isLoose()) throw new Error("Loose triangles fit together from the nodal point only. Choose another shape.");
    const [x, y, z] = eyeWords(eye).split(",");
    if (moved) await ask(`eye?envelope=${at("envelope").selectedIndex}&x=${x}&y=${y}&z=${z}`);
    camera.eye = eye;
    if (!message.dataset.gone) say("");
  } catch (error) {
    say(error.message);
  }
  stage.removeAttribute("aria-busy");
  at("eye").value = eyeWords(camera.eye);
  changed();
}

let eyeMoves = Promise.resolve(); // one after another, each from where the one before has ended
function step(right, up, ahead) {
  if (camera.side === "outside") return;
  const length = kStepOfEye * view.radius;
  stage.setAttribute("aria-busy", "true");
  eyeMoves = eyeMoves.then(() => moveEye(camera.eyeAfter(right * length, up * length, ahead * length)));
}

async function setEnvelope() {
  at("stage").setAttribute("aria-busy", "true");
  try {
    const answer = await ask(`mesh.glb?envelope=${isLoose() ? 0 : at("envelope").selectedIndex}`);
    await view.setMesh(await answer.arrayBuffer(), isLoose());
    if (!message.dataset.gone) say("");
    const eye = camera.eye;
    camera.eye = [0, 0, 0];
    await moveEye(eye);
  } catch (error) {
    say(error.message);
  }
  at("stage").removeAttribute("aria-busy");
  changed();
}

async function setPicture() {
  const longer = Math.max(scene.picture_width, scene.picture_height);
  const side = Math.min(longer, view.largestPicture);
  const answer = await ask(`picture?side=${side}`);
  const asStored = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  const bitmap = await createImageBitmap(await answer.blob(), asStored);
  view.setPicture(bitmap, scene.even);
  if (side < longer) {
    addNote(`The picture is shown with ${bitmap.width}x${bitmap.height} of its ${scene.picture_width}x` +
      `${scene.picture_height} px, because the graphics of this browser take no larger ones.`);
  }
}

/// A picture of the film instead of the one before.
function setFrame(bitmap) {
  view.setPicture(bitmap, scene.even, true);
  changed();
}

function addNote(text) {
  const item = document.createElement("li");
  item.textContent = text;
  at("notes").append(item);
}

function next(id) {
  const select = at(id);
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  select.dispatchEvent(new Event("change"));
}

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else stage.requestFullscreen?.().catch(() => say("This browser does not allow full screen here."));
}

function connectControls() {
  for (const { title } of scene.envelopes) at("envelope").append(new Option(title));
  at("envelope").append(new Option("soup of triangles"));
  for (const id of ["side", "projection"]) at(id).addEventListener("change", look);
  at("envelope").addEventListener("change", setEnvelope);
  const reset = () => { camera.reset(); moveEye(camera.eye); };
  at("eye").addEventListener("change", () => {
    const [x, y, z] = at("eye").value.split(",").map(Number);
    if ([x, y, z].every(Number.isFinite)) moveEye([x, -y, -z]);
    else say("Give the eye as three numbers: right, down, ahead, such as 0.1,0,0.2.");
  });
  const button = (id, action) => at(id).addEventListener("click", () => { action(); changed(); });
  button("closer", () => camera.zoom(1 / kKeyZoom));
  button("farther", () => camera.zoom(kKeyZoom));
  button("reset", reset);
  button("full", fullScreen);
  listen(canvas, camera, changed, {
    w: () => step(0, 0, 1), s: () => step(0, 0, -1), a: () => step(-1, 0, 0), d: () => step(1, 0, 0),
    r: () => step(0, 1, 0), v: () => step(0, -1, 0),
    Home: reset, i: () => next("side"), p: () => next("projection"), e: () => next("envelope"), f: fullScreen,
    ...filmKeys,
    k: connectPath(camera, at, () => (scene.pictures > 1 ? Number(at("time").dataset.shown) : null)),
  });
  if (!document.fullscreenEnabled) at("full").hidden = true;
  new ResizeObserver(resize).observe(stage);
}

/// The program ends a minute after the last page is closed; it knows by this connection that there is one.
function stayConnected() {
  const events = new EventSource("events");
  events.onopen = () => { if (message.dataset.gone) { delete message.dataset.gone; say(""); } };
  events.onerror = () => {
    message.dataset.gone = "1";
    say("The program has ended, or too many pages of it are open. What is shown stays; start `nodal look` again " +
      "for more.");
  };
}

function watchGraphics() {
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    showFlat("This computer's graphics stopped (WebGL was lost). The picture is shown flat; reload the page to try " +
      "again.");
  });
}

async function start() {
  scene = await (await ask("scene.json")).json();
  document.title = `${scene.name} – nodal look`;
  at("name").textContent = scene.name;
  at("size").textContent = `${scene.layout}, ${scene.width}×${scene.height} px`;
  scene.notes.forEach(addNote);
  stayConnected();
  if (scene.flat) return showFlat(scene.flat);
  try {
    view = new SphereView(canvas);
  } catch {
    return showFlat("This browser has no WebGL, which draws the sphere. The picture is shown flat.");
  }
  watchGraphics();
  const film = scene.pictures > 1;
  if (film) {
    filmKeys = await connectFilm(ask, setFrame, say);
    at("same").hidden = at("command").parentElement.hidden = true;
  }
  connectControls();
  resize();
  await Promise.all([film ? null : setPicture(), setEnvelope()]);
  if (scene.live) {
    watchRig(setFrame, say, stage, at("age"));
    at("same").hidden = at("command").parentElement.hidden = true;
  }
  changed();
  document.documentElement.dataset.ready = "1";
}

start().catch((error) => say(error.message));
