// What the pages have in common: requests, a message for people, a view that fills its stage and is drawn after changes.

export const at = (id) => document.getElementById(id);
export const kAsStored = { colorSpaceConversion: "none", premultiplyAlpha: "none" }; // of pictures that are decoded

export function say(text) {
  const message = at("message");
  if (message.textContent !== text) message.textContent = text;
  message.hidden = !text;
}

/// The answer, or an error with its status whose message is the program's sentence.
export async function ask(path, options) {
  const answer = await fetch(path, options);
  if (!answer.ok) throw Object.assign(new Error(await answer.text()), { status: answer.status });
  return answer;
}
export const read = async (path) => (await ask(path)).json();
/// A picture of the program.
export const picture = async (path) => createImageBitmap(await (await ask(path)).blob(), kAsStored);

export function listed(id, texts) {
  at(id).replaceChildren(...texts.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

export class Stage {
  /// `drawn()` is called after each time that the view was drawn.
  constructor(camera, drawn = () => {}) {
    Object.assign(this, { camera, drawn });
    this.canvas = at("view");
    this.box = at("stage");
    this.view = null;
    this.waiting = false;
    this.changed = () => this.change();
  }

  change() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (!this.view || this.canvas.hidden) return;
      this.view.draw(this.camera);
      this.drawn();
    });
  }

  /// Makes the view, of a class that draws, and fits it to its stage from now on. False where there is no WebGL.
  begin(View) {
    try {
      this.view = new View(this.canvas);
    } catch {
      return false;
    }
    new ResizeObserver(() => this.resize()).observe(this.box);
    return true;
  }

  resize() {
    // Whole pixels, at whole pixels of the window: otherwise the browser would blur what is drawn.
    const { left, top, right, bottom } = this.box.getBoundingClientRect();
    const width = Math.max(1, Math.floor(right) - Math.ceil(left));
    const height = Math.max(1, Math.floor(bottom) - Math.ceil(top));
    this.canvas.style.left = `${Math.ceil(left) - left}px`;
    this.canvas.style.top = `${Math.ceil(top) - top}px`;
    this.camera.resize(width, height);
    this.view.resize(width, height);
    this.change();
  }

  /// Where it looks, in words, and as data for scripts.
  tell(output) {
    const { yaw, pitch, roll, fov } = this.camera;
    const degrees = (value) => `${(Math.round(value * 10) / 10).toFixed(1)}°`;
    output.textContent = `yaw ${degrees(yaw)}, pitch ${degrees(pitch)}, ` +
      `${roll ? `roll ${degrees(roll)}, ` : ""}${degrees(fov)} wide`;
    Object.assign(output.dataset, { yaw, pitch, roll, fov });
  }
}

/// The program ends a minute after the last page is closed; it knows by this connection that there is one.
export function stayConnected() {
  const message = at("message"), events = new EventSource("events");
  events.onopen = () => { if (message.dataset.gone) { delete message.dataset.gone; say(""); } };
  events.onerror = () => {
    message.dataset.gone = "1";
    say("The program has ended, or too many pages of it are open. What is shown stays; start `nodal look` again " +
      "for more.");
  };
}
