// The view follows a phone that is turned, where the browser tells its motion to the page.

import { turned, wrapped } from "./projection.js";

const kRadian = Math.PI / 180;
const kSilent = 1500; // ms without an event: there is no gyroscope

/// The view's yaw, pitch and roll in degrees of a device that the angles of a DeviceOrientationEvent describe; `screen`:
/// how the page is turned on it. W3C's axes: of the earth, x east, y north, z up; of the device, x right, y to its upper
/// end, z out of the screen; alpha about z, then beta about the new x, then gamma about the new y.
export function orientationOf(alpha, beta, gamma, screen = 0) {
  const [ca, cb, cg] = [alpha, beta, gamma].map((angle) => Math.cos(angle * kRadian));
  const [sa, sb, sg] = [alpha, beta, gamma].map((angle) => Math.sin(angle * kRadian));
  // The device's axes in those of the earth, each as a column.
  const right = [ca * cg - sa * sb * sg, sa * cg + ca * sb * sg, -cb * sg];
  const upper = [-sa * cb, ca * cb, sb];
  const out = [ca * sg + sa * sb * cg, sa * sg - ca * sb * cg, cb * cg];
  const cs = Math.cos(screen * kRadian), ss = Math.sin(screen * kRadian);
  const ofPage = right.map((value, k) => cs * value - ss * upper[k]);
  // In the view's axes: x east, y up, z south.
  const view = ([east, north, up]) => [east, up, -north];
  const [x, z] = [view(ofPage), view(out)];
  const pitch = Math.asin(Math.max(-1, Math.min(1, -z[1]))) / kRadian;
  const yaw = Math.atan2(-z[0], z[2]) / kRadian;
  const level = turned([1, 0, 0], yaw, pitch), above = turned([0, 1, 0], yaw, pitch);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return { yaw, pitch, roll: Math.atan2(-dot(x, above), dot(x, level)) / kRadian };
}

/// The button follows the phone, and stops. What the browser does not allow is said in a sentence.
export function connectGyroscope(button, camera, changed, say) {
  let following = false, first = true, turn = 0, set = 0, timer = 0;
  button.hidden = !(navigator.maxTouchPoints > 0);
  const follow = (event) => {
    if (event.alpha === null || event.beta === null || event.gamma === null) return;
    clearTimeout(timer);
    const is = orientationOf(event.alpha, event.beta, event.gamma, globalThis.screen?.orientation?.angle ?? 0);
    // It begins where the view looks. A drag turns the view further from there.
    turn = first ? camera.yaw - is.yaw : turn + camera.yaw - set;
    first = false;
    camera.yaw = set = wrapped(is.yaw + turn);
    camera.pitch = is.pitch;
    camera.roll = is.roll;
    changed();
  };
  const stop = () => {
    following = false;
    clearTimeout(timer);
    removeEventListener("deviceorientation", follow);
    button.setAttribute("aria-pressed", "false");
    camera.roll = 0;
    changed();
  };
  button.addEventListener("click", async () => {
    if (following) return stop();
    if (!isSecureContext) return say("Browsers tell a phone's motion to pages over https only. Open this page over https.");
    if (!globalThis.DeviceOrientationEvent) return say("This browser does not tell pages how the device is turned.");
    try {
      // iOS asks the user, and only in a click.
      const answer = await DeviceOrientationEvent.requestPermission?.();
      if (answer && answer !== "granted") throw new Error("refused");
    } catch {
      return say("The browser was not allowed to tell the phone's motion. Reload the page to be asked again.");
    }
    following = first = true;
    button.setAttribute("aria-pressed", "true");
    addEventListener("deviceorientation", follow);
    timer = setTimeout(() => {
      stop();
      say("This device tells no motion: it has no gyroscope, or the browser's settings forbid it.");
    }, kSilent);
    return undefined;
  });
}
