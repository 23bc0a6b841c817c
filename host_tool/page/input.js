// Drags, pinches, the wheel and keys on the view, as changes of the camera.

const kWheel = 0.0012; // change of log(field of view) by px of a wheel
const kStep = 5, kSmallStep = 0.5; // degrees by key
const kZoom = 1.15;

/// `changed` is called after each change; `actions` has a function for each key beside those that turn and zoom.
export function listen(canvas, camera, changed, actions) {
  const fingers = new Map(); // pointers that are down: place
  let grabbed = null;
  let pinch = 0;

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const middle = () => {
    const all = [...fingers.values()];
    return [0, 1].map((k) => all.reduce((sum, at) => sum + at[k], 0) / all.length);
  };
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  /// After a finger came or went.
  const begin = () => {
    grabbed = fingers.size > 0 ? camera.grab(...middle()) : null;
    pinch = fingers.size === 2 ? spread() : 0;
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, place(event));
    begin();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, place(event));
    if (fingers.size === 2 && pinch > 0) {
      camera.zoom(pinch / Math.max(1, spread()));
      pinch = Math.max(1, spread());
    }
    camera.drag(grabbed, ...middle());
    changed();
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => {
      if (fingers.delete(event.pointerId)) begin();
    });
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * 16;
    camera.zoom(Math.exp(pixels * kWheel));
    changed();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = event.shiftKey ? kSmallStep : kStep;
    const keys = {
      ArrowLeft: () => camera.turn(-step, 0), ArrowRight: () => camera.turn(step, 0),
      ArrowUp: () => camera.turn(0, step), ArrowDown: () => camera.turn(0, -step),
      "+": () => camera.zoom(1 / kZoom), "=": () => camera.zoom(1 / kZoom), "-": () => camera.zoom(kZoom),
      ...actions,
    };
    const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
    changed();
  });
}

export const kKeyZoom = kZoom;
