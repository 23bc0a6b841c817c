// The rig's state in words, and the controls. A control shows what the rig says, not what was pressed.

import { SkewChart } from "./skew_chart.js";

const at = (id) => document.getElementById(id);
const chart = new SkewChart(at("skew"), at("apart"));

const seconds = (ns) => {
  const whole = Math.floor(ns / 1e9);
  const two = (value) => String(value).padStart(2, "0");
  return `${whole >= 3600 ? `${Math.floor(whole / 3600)}:` : ""}${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
};
const gigabytes = (bytes) => `${(bytes / 1e9).toFixed(bytes < 1e10 ? 1 : 0)} GB`;
const sum = (counts) => Object.values(counts).reduce((a, b) => a + b, 0);
const exposureWords = (ns) => (ns >= 1e6 ? `${(ns / 1e6).toFixed(1)} ms` : `${(ns / 1e3).toFixed(0)} µs`);

let operates = false, busy = false, answers = false, recording = null;

function enable() {
  for (const id of ["record", "still", "mark", "program", "locked", "genlock"]) at(id).disabled = !operates || busy || !answers;
  if (!recording) at("record").disabled = at("still").disabled = true; // a rig without a disk for takes
  at("mark").disabled ||= recording?.take == null;
}

function showRecording(takes) {
  recording = takes;
  const on = takes?.take != null;
  const button = at("record");
  button.classList.toggle("recording", on);
  button.setAttribute("aria-pressed", String(on));
  button.textContent = on ? "Stop recording" : "Record";
  if (!takes) {
    at("take").textContent = "This rig records nothing: its rig.toml has no [takes].";
    at("disk").textContent = "";
    return;
  }
  const durable = takes.durable_ns == null ? "nothing of it is safe on the disk yet"
    : `all but the last ${(takes.durable_ns / 1e9).toFixed(1)} s is safe on the disk`;
  const lost = takes.lost_sets ? `, ${takes.lost_sets} sets lost` : "";
  at("take").textContent = on ? `Take ${takes.take}: ${seconds(takes.length_ns)}, ${takes.sets} sets${lost}; ${durable}.`
    : "Not recording.";
  const left = takes.bytes_a_second > 0 ? `${seconds((takes.free_bytes / takes.bytes_a_second) * 1e9)} left, ` : "";
  at("disk").textContent = takes.problem || (takes.total_bytes > 0
    ? `${left}${gigabytes(takes.free_bytes)} free of ${gigabytes(takes.total_bytes)}.` : "");
}

function showHeads(heads, exposure) {
  const rows = heads.map((head) => {
    const row = document.createElement("tr");
    const cell = (text, bad = false) => {
      const made = document.createElement("td");
      made.textContent = text;
      made.classList.toggle("bad", bad);
      row.append(made);
    };
    const light = exposure.heads.find((each) => each.index === head.index);
    const lost = Object.entries(head.losses).filter(([, frames]) => frames > 0);
    cell(head.present ? head.name : `${head.name} is missing`, !head.present);
    cell(exposureWords(head.exposure_ns));
    cell(light?.metered ? `${(light.clipped_ppm / 1e4).toFixed(1)} %` : "not measured", (light?.clipped_ppm ?? 0) > 10000);
    cell(`${Math.round(head.skew_ns / 1e3) || 0} µs`);  // never -0
    cell(lost.length ? lost.map(([reason, frames]) => `${reason} ${frames}`).join(", ") : "none", lost.length > 0);
    return row;
  });
  at("heads").replaceChildren(...rows);
}

/// When the rig does not answer. What it said last stays, but its state is not known.
export function showNoRig() {
  answers = false;
  at("state").textContent = "The rig does not answer.";
  enable();
}

/// What the rig says: {status, heads, exposure}.
export function showState({ status, heads, exposure }) {
  answers = true;
  at("name").textContent = status.rig || "The rig";
  document.title = status.rig || "The rig";
  const rate = `${(status.rate_millihertz / 1000).toFixed(1)} pictures a second`;
  at("state").textContent = [status.state, rate, status.problem].filter(Boolean).join(", ");
  showRecording(status.recording);
  const lock = status.genlock;
  at("genlock").setAttribute("aria-pressed", String(lock.state !== "off"));
  at("genlock").textContent = lock.state === "off" ? "Start genlock" : "Stop genlock";
  at("sync").textContent = `Genlock ${lock.state}; ` +
    `${sum(status.losses)} of ${status.frames_taken} frames lost.`;
  chart.add(lock.state === "off" ? null : lock.spread_ns);
  if (!busy) {
    at("program").value = exposure.program;
    at("locked").checked = exposure.locked;
  }
  showHeads(heads, exposure);
  enable();
}

/// `order(path, document)` sends a change to the rig.
export function connectControls(order, mayOperate) {
  operates = mayOperate;
  const send = async (path, document, done) => {
    if (busy) return; // a second press of a button is none
    busy = true;
    enable();
    at("said").textContent = "";
    try {
      const answer = await order(path, document);
      at("said").textContent = answer.not_stored ? `${done(answer)} It is not kept: ${answer.not_stored}` : done(answer);
    } catch (error) {
      at("said").textContent = `Not done: ${error.message}`;
    } finally {
      busy = false;
      enable();
    }
  };
  const press = (id, action) => at(id).addEventListener("click", action);
  press("record", () => {
    const on = recording?.take == null;
    send("api/record", { on }, ({ take }) => (on ? `Take ${take} has begun.` : `Take ${take} is complete.`));
  });
  press("still", () => send("api/still", {}, ({ take }) => `Still ${take} is on the disk.`));
  press("mark", () => send("api/mark", { text: "marked on the page" }, () => "Marked."));
  press("genlock", () => {
    const on = at("genlock").getAttribute("aria-pressed") !== "true";
    send("api/genlock", { on }, () => (on ? "Genlock starts." : "Genlock has stopped."));
  });
  at("program").addEventListener("change", () =>
    send("api/exposure", { program: at("program").value }, () => "Exposure program set."));
  at("locked").addEventListener("change", () =>
    send("api/exposure", { locked: at("locked").checked }, () => "Exposure lock set."));
  enable();
}
