// The page: asks the program what is shown, and connects the camera, the drawing and the controls.

import { Camera, eyeWords } from "./camera.js";
import { connectFilm } from "./film_controls.js";
import { connectGyroscope } from "./gyroscope.js";
import { connectHeadset } from "./headset.js";
import { kKeyZoom, listen } from "./input.js";
import { watchRig } from "./live.js";
import { connectPath } from "./path.js";
import { SphereView } from "./sphere_view.js";
import { Stage, ask, at, picture, read, say, stayConnected } from "./stage.js";

const message = at("message"), flat = at("flat");
const camera = new Camera();
const stage = new Stage(camera, tell);
const { canvas, changed } = stage;
const kStepOfEye = 0.05; // by key, of the envelope's radius
let scene = null, filmKeys = {};

/// Shows the picture flat, and says why.
function showFlat(why) {
  flat.src = `picture?side=${Math.min(4096, Math.max(scene.picture_width, scene.picture_height))}`;
  flat.hidden = false;
  canvas.hidden = true;
  at("tools").hidden = at("about").hidden = true;
  say(why);
}

function tell() {
  stage.tell(at("where"));
  if (scene.pictures > 1) return;
  at("command").textContent = isLoose() ? "nodal view has no soup of triangles; choose another shape"
    : camera.command(scene, scene.envelopes[at("envelope").selectedIndex], stage.view.radius);
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
  stage.box.setAttribute("aria-busy", "true");
  try {
    if (moved && isLoose()) throw new Error("Loose triangles fit together from the nodal point only. Choose another shape.");
    const [x, y, z] = eyeWords(eye).split(",");
    if (moved) await ask(`eye?envelope=${at("envelope").selectedIndex}&x=${x}&y=${y}&z=${z}`);
    camera.eye = eye;
    if (!message.dataset.gone) say("");
  } catch (error) {
    say(error.message);
  }
  stage.box.removeAttribute("aria-busy");
  at("eye").value = eyeWords(camera.eye);
  changed();
}

let eyeMoves = Promise.resolve(); // one after another, each from where the one before has ended
function step(right, up, ahead) {
  if (camera.side === "outside") return;
  const length = kStepOfEye * stage.view.radius;
  stage.box.setAttribute("aria-busy", "true");
  eyeMoves = eyeMoves.then(() => moveEye(camera.eyeAfter(right * length, up * length, ahead * length)));
}

async function setEnvelope() {
  stage.box.setAttribute("aria-busy", "true");
  try {
    const answer = await ask(`mesh.glb?envelope=${isLoose() ? 0 : at("envelope").selectedIndex}`);
    await stage.view.setMesh(await answer.arrayBuffer(), isLoose());
    if (!message.dataset.gone) say("");
    const eye = camera.eye;
    camera.eye = [0, 0, 0];
    await moveEye(eye);
  } catch (error) {
    say(error.message);
  }
  stage.box.removeAttribute("aria-busy");
  changed();
}

async function setPicture() {
  const longer = Math.max(scene.picture_width, scene.picture_height);
  const side = Math.min(longer, stage.view.largestPicture);
  const bitmap = await picture(`picture?side=${side}`);
  stage.view.setPicture(bitmap, scene.even);
  if (side < longer) {
    addNote(`The picture is shown with ${bitmap.width}x${bitmap.height} of its ${scene.picture_width}x` +
      `${scene.picture_height} px, because the graphics of this browser take no larger ones.`);
  }
}

/// A picture of the film instead of the one before.
function setFrame(bitmap) {
  stage.view.setPicture(bitmap, scene.even, true);
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
  else stage.box.requestFullscreen?.().catch(() => say("This browser does not allow full screen here."));
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
  connectGyroscope(at("gyroscope"), camera, changed, say);
  connectHeadset(at("headset"), stage.view, camera, changed, say);
}

function watchGraphics() {
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    showFlat("This computer's graphics stopped (WebGL was lost). The picture is shown flat; reload the page to try " +
      "again.");
  });
}

async function start() {
  scene = await read("scene.json");
  document.title = `${scene.name} – nodal look`;
  at("name").textContent = scene.name;
  at("size").textContent = `${scene.layout}, ${scene.width}×${scene.height} px`;
  scene.notes.forEach(addNote);
  stayConnected();
  if (scene.flat) return showFlat(scene.flat);
  if (!stage.begin(SphereView))
    return showFlat("This browser has no WebGL, which draws the sphere. The picture is shown flat.");
  watchGraphics();
  const film = scene.pictures > 1;
  if (film) {
    filmKeys = await connectFilm((k) => picture(`frame?k=${k}`), setFrame);
    at("same").hidden = at("command").parentElement.hidden = true;
  }
  connectControls();
  stage.resize();
  await Promise.all([film ? null : setPicture(), setEnvelope()]);
  if (scene.live) {
    watchRig(setFrame, say, stage.box, at("age"));
    at("same").hidden = at("command").parentElement.hidden = true;
  }
  changed();
  document.documentElement.dataset.ready = "1";
}

start().catch((error) => say(error.message));
