// The page of a rig: the live sphere, its state, and controls. Everything that it shows comes from the rig.

import { Camera } from "./camera.js";
import { listen } from "./input.js";
import { watchRig } from "./live.js";
import { connectControls, showNoRig, showState } from "./rig_controls.js";
import { connectTakes } from "./rig_takes.js";
import { SphereView } from "./sphere_view.js";

const kEvery = 1000; // ms, between two questions for the state
const at = (id) => document.getElementById(id);
const canvas = at("view"), stage = at("stage"), message = at("message");
const camera = new Camera();
let view = null, scene = null, waiting = false, gone = "";

function say(text) {
  const shown = text || gone;
  if (message.textContent !== shown) message.textContent = shown;
  message.hidden = !shown;
}

/// The answer, or an error whose message is the program's sentence.
export async function ask(path, options) {
  const answer = await fetch(path, options);
  if (answer.status === 401) location.reload(); // the device is no longer paired: the page says so
  if (!answer.ok) throw new Error(await answer.text());
  return answer;
}

const order = (path, document) => ask(path, {
  method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(document),
}).then((answer) => answer.json());

function changed() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    view?.draw(camera);
    Object.assign(stage.dataset, { yaw: camera.yaw, pitch: camera.pitch, fov: camera.fov });
  });
}

function resize() {
  const { width, height } = stage.getBoundingClientRect();
  camera.resize(Math.max(1, Math.floor(width)), Math.max(1, Math.floor(height)));
  view?.resize(camera.width, camera.height);
  changed();
}

/// The triangles of the newest raymap's layout; again after the rig came back with another one.
async function readScene() {
  const next = await (await ask("scene.json")).json();
  const same = scene && ["layout", "picture_width", "picture_height"].every((key) => scene[key] === next[key]);
  scene = next;
  if (!same) await view?.setMesh(await (await ask("mesh.glb?envelope=0")).arrayBuffer(), false);
}

async function setPicture(bitmap) {
  if (!scene || bitmap.width !== scene.picture_width || bitmap.height !== scene.picture_height) await readScene();
  view?.setPicture(bitmap, scene.even, true);
  changed();
}

async function poll(rights) {
  try {
    if (document.hidden) return;
    const answer = await (await ask("api/state")).json();
    showState(answer, rights);
    gone = "";
  } catch (error) {
    gone = `The rig is gone: ${error.message}`;
    showNoRig();
    document.documentElement.dataset.gone = "1";
  } finally {
    if (!gone) delete document.documentElement.dataset.gone;
    say("");
    setTimeout(() => poll(rights), kEvery);
  }
}

function takeProjection() {
  const all = ["perspective", "fisheye", "stereographic"];
  camera.look("inside", all[(all.indexOf(camera.projection) + 1) % all.length]);
}

async function start() {
  const me = await (await ask("api/me")).json();
  at("rights").textContent = me.rights === "operate" ? `${me.name} operates the rig` : `${me.name} watches`;
  connectControls(order, me.rights === "operate");
  connectTakes(ask, order, me.rights === "operate");
  poll(me.rights);
  try {
    view = new SphereView(canvas);
  } catch {
    say("This browser has no WebGL, which draws the sphere.");
    return;
  }
  listen(canvas, camera, changed, { Home: () => camera.reset(), p: takeProjection });
  new ResizeObserver(resize).observe(stage);
  resize();
  watchRig(setPicture, say, stage, at("age"), (status) => { if (status === 401) location.reload(); });
  document.documentElement.dataset.ready = "1";
}

start().catch((error) => say(error.message));
