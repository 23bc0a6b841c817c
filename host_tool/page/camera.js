// What the page looks at: inside or outside, where to, how wide, in which projection. No drawing, no document.

import { focalLength, metSphere, projections, rayAt, rolled, turnTo, turned, unturned, wrapped } from "./projection.js";

const kNarrowest = 2; // degrees
const kOutside = 42; // degrees across the shorter side, the usual field of view from outside
const kHome = { inside: { yaw: 0, pitch: 0 }, outside: { yaw: -30, pitch: -20 } }; // outside, so that edges are seen
const kDistance = 3; // of the eye outside, in radii

const number = (value) => String(Number(value.toFixed(4)) || 0);

/// An eye as `nodal view --eye` takes it: x right, y down, z ahead.
export function eyeWords([x, y, z]) {
  return [x, -y, -z].map(number).join(",");
}

export class Camera {
  constructor() {
    this.side = "inside";
    this.projection = "perspective";
    this.width = this.height = 1; // px
    this.reset();
  }

  reset() {
    Object.assign(this, kHome[this.side]);
    this.roll = 0; // degrees, clockwise; a phone's, inside
    this.eye = [0, 0, 0]; // inside, in the sphere's axes and the envelope's unit; from outside it is on the axis
    this.fov = this.usualFov();
  }

  resize(width, height) {
    const usual = this.fov === this.usualFov();
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    if (usual) this.fov = this.usualFov();
  }

  /// Inside, of the longer side, so that a high and narrow window shows no more than a wide one. Outside, of the
  /// shorter one, so that the whole envelope is seen.
  usualFov() {
    const { usual, widest, distance, angle } = projections[this.projection];
    const outside = this.side === "outside";
    const sides = [this.width, this.height];
    const share = this.width / (outside ? Math.min(...sides) : Math.max(...sides));
    const half = ((outside ? kOutside : usual) * Math.PI) / 360;
    return Math.min(widest, (2 * angle(share * distance(half)) * 180) / Math.PI);
  }

  look(side, projection) {
    const home = this.yaw === kHome[this.side].yaw && this.pitch === kHome[this.side].pitch;
    this.side = side;
    this.projection = projection;
    if (home) Object.assign(this, kHome[side]);
    this.roll = 0;
    this.fov = this.usualFov();
  }

  get focal() {
    return focalLength(this.projection, this.fov, this.width);
  }

  /// How far the eye is behind the centre, in radii of the envelope; 0 inside.
  get distance() {
    return this.side === "outside" ? kDistance : 0;
  }

  /// Where the eye would be after steps to the right, up and ahead as the view stands.
  eyeAfter(right, up, ahead) {
    return turned(rolled([right, up, -ahead], this.roll), this.yaw, this.pitch).map((step, k) => this.eye[k] + step);
  }

  zoom(factor) {
    this.fov = Math.max(kNarrowest, Math.min(projections[this.projection].widest, this.fov * factor));
  }

  turn(yaw, pitch) {
    this.yaw = wrapped(this.yaw + yaw);
    this.pitch = Math.max(-90, Math.min(90, this.pitch + pitch));
  }

  /// The camera's vector at a pixel, as if it had no roll: its ray, and from outside the point of the sphere. Null where
  /// nothing is shown.
  vectorAt(x, y) {
    const straight = rayAt(this.projection, this.focal, x - this.width / 2, this.height / 2 - y);
    const ray = straight && rolled(straight, this.roll);
    return ray && this.distance > 0 ? metSphere(ray, this.distance) : ray;
  }

  /// What is at a pixel, as a direction from the centre, in the sphere's axes.
  grab(x, y) {
    const vector = this.vectorAt(x, y);
    return vector && turned(vector, this.yaw, this.pitch);
  }

  /// The pixel at which a direction is seen; null where it is not.
  pixelOf(direction) {
    const [x, y, z] = rolled(unturned(direction, this.yaw, this.pitch), -this.roll);
    const beside = Math.hypot(x, y), angle = Math.atan2(beside, -z);
    const { distance, widest } = projections[this.projection];
    if (angle >= (Math.min(widest, 359) * Math.PI) / 360) return null;
    const scale = beside > 0 ? (this.focal * distance(angle)) / beside : 0;
    return [this.width / 2 + scale * x, this.height / 2 - scale * y];
  }

  /// Turns so that what was grabbed is at a pixel.
  drag(grabbed, x, y) {
    const vector = this.vectorAt(x, y);
    if (!vector || !grabbed) return;
    const to = turnTo(vector, grabbed, this.pitch);
    this.yaw = to.yaw;
    this.pitch = to.pitch;
  }

  /// The words of `nodal view` for this view.
  command(scene, envelope, radius) {
    const quoted = (word) => (/^[\w./:,=-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
    const words = ["nodal", "view", quoted(scene.file)];
    if (scene.from) words.push("--from", quoted(scene.from));
    words.push("-o", "view.png", "--camera", this.projection, "--yaw", number(this.yaw), "--pitch", number(this.pitch));
    if (this.roll) words.push("--roll", number(this.roll));
    words.push("--fov", number(this.fov), "--size", `${Math.round(this.width)}x${Math.round(this.height)}`);
    const eye = this.distance > 0 ? turned([0, 0, this.distance * radius], this.yaw, this.pitch) : this.eye;
    if (eye.some((value) => value !== 0)) {
      words.push("--envelope", quoted(envelope.option), "--eye", eyeWords(eye));
    }
    return words.join(" ");
  }
}
