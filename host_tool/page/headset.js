// The sphere in a headset (WebXR), where the browser has one.

const kSession = "immersive-vr";

/// The button begins and ends a session. `view` draws; `camera` says where it begins. What the browser does not allow is
/// said in a sentence.
export async function connectHeadset(button, view, camera, changed, say) {
  const { xr } = navigator;
  let session = null;
  const supported = (await xr?.isSessionSupported?.(kSession).catch(() => false)) ?? false;
  button.hidden = !supported && !(navigator.maxTouchPoints > 0);
  button.addEventListener("click", async () => {
    if (session) return session.end();
    if (!isSecureContext) return say("Browsers show pages in a headset over https only. Open this page over https.");
    if (!xr) return say("This browser has no WebXR, which headsets need.");
    if (!supported) return say("This browser finds no headset.");
    try {
      session = await xr.requestSession(kSession);
      await view.enter(session, camera);
    } catch (error) {
      session?.end?.();
      session = null;
      return say(`The headset does not show the sphere: ${error.message}`);
    }
    button.setAttribute("aria-pressed", "true");
    session.addEventListener("end", () => {
      session = null;
      view.leave();
      button.setAttribute("aria-pressed", "false");
      changed();
    });
    return undefined;
  });
}
