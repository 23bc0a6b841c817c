// The page of a rig: the live sphere, its state, and controls. Everything that it shows comes from the rig.

import { Camera } from "./camera.js";
import { connectGyroscope } from "./gyroscope.js";
import { connectHeadset } from "./headset.js";
import { listen } from "./input.js";
import { watchRig } from "./live.js";
import { connectControls, showNoRig, showState } from "./rig_controls.js";
import { connectTakes } from "./rig_takes.js";
import { SphereView } from "./sphere_view.js";
import * as page from "./stage.js";

const kEvery = 1000; // ms, between two questions for the state
const { at } = page;
const camera = new Camera();
const stage = new page.Stage(camera, () => {
  const { yaw, pitch, roll, fov } = camera;
  Object.assign(stage.box.dataset, { yaw, pitch, roll, fov });
});
const { canvas, changed } = stage;
let scene = null, gone = "";

const say = (text) => page.say(text || gone);

/// The answer, or an error whose message is the program's sentence.
export async function ask(path, options) {
  try {
    return await page.ask(path, options);
  } catch (error) {
    if (error.status === 401) location.reload(); // the device is no longer paired: the page says so
    throw error;
  }
}

const order = (path, document) => ask(path, {
  method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(document),
}).then((answer) => answer.json());

/// The triangles of the newest raymap's layout; again after the rig came back with another one.
async function readScene() {
  const next = await (await ask("scene.json")).json();
  const same = scene && ["layout", "picture_width", "picture_height"].every((key) => scene[key] === next[key]);
  scene = next;
  if (!same) await stage.view?.setMesh(await (await ask("mesh.glb?envelope=0")).arrayBuffer(), false);
}

async function setPicture(bitmap) {
  if (!scene || bitmap.width !== scene.picture_width || bitmap.height !== scene.picture_height) await readScene();
  stage.view?.setPicture(bitmap, scene.even, true);
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
  if (!stage.begin(SphereView)) {
    say("This browser has no WebGL, which draws the sphere.");
    return;
  }
  listen(canvas, camera, changed, { Home: () => camera.reset(), p: takeProjection });
  connectGyroscope(at("gyroscope"), camera, changed, say);
  connectHeadset(at("headset"), stage.view, camera, changed, say);
  stage.resize();
  watchRig(setPicture, say, stage.box, at("age"), (status) => { if (status === 401) location.reload(); });
  document.documentElement.dataset.ready = "1";
}

start().catch((error) => say(error.message));
