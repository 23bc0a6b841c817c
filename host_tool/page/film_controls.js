// The controls of a film: play and pause, a slider, one picture on or back, the time.

import { Player } from "./player.js";
import { at, read, say } from "./stage.js";

function clock(ms) {
  const seconds = Math.floor(ms / 1000);
  const two = (value) => String(value).padStart(2, "0");
  return `${Math.floor(seconds / 60)}:${two(seconds % 60)}.${Math.floor((ms % 1000) / 100)}`;
}

/// `load(k)` gives picture k, `setPicture(picture)` draws it. Gives the actions of keys.
export async function connectFilm(load, setPicture) {
  const times = [0];
  for (const step of await read("times.json")) times.push(times.at(-1) + step);
  const slider = at("moment"), play = at("play"), time = at("time");
  const tell = (k) => {
    slider.value = k;
    const text = `picture ${k + 1} of ${times.length}, ${clock(times[k])} of ${clock(player.length)}`;
    slider.setAttribute("aria-valuetext", text);
    time.textContent = text;
    Object.assign(time.dataset, { shown: k, dropped: player.dropped, drawn: player.drawn });
  };
  let first = null;
  const begun = new Promise((done) => { first = done; });
  const player = new Player(times, {
    load,
    show: (k, picture) => { setPicture(picture); tell(k); first(); },
    failed: (error) => { say(error.message); label(); first(); },
  });
  const label = () => { play.textContent = player.playing ? "Pause" : "Play"; };
  const toggle = () => {
    if (player.playing) player.pause();
    else player.play();
    label();
  };
  const step = (by) => { player.step(by); label(); };
  player.ended = label;
  slider.max = times.length - 1;
  slider.addEventListener("input", () => player.seek(Number(slider.value)));
  play.addEventListener("click", toggle);
  at("back").addEventListener("click", () => step(-1));
  at("on").addEventListener("click", () => step(1));
  document.addEventListener("visibilitychange", () => { if (document.hidden) { player.pause(); label(); } });
  at("film").hidden = false;
  player.seek(0);
  await begun;
  return { " ": toggle, ",": () => step(-1), ".": () => step(1) };
}
