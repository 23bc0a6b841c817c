// The calibration on trial on the rig: tried from the page, then kept or dropped.

import { at, say } from "./stage.js";

/// `change(what)` asks the program. Gives a function that shows the state of the trial that the program tells.
export function connectTrial(rig, change) {
  at("trial").hidden = !rig;
  for (const what of ["try", "keep", "drop"]) at(what).addEventListener("click", () => change(what));
  let under = false;
  return (trial) => {
    const deciding = trial?.phase === "on trial", was = under;
    under = trial?.under_way ?? false;
    at("try").disabled = under;
    at("keep").hidden = at("drop").hidden = !deciding;
    const left = deciding && trial.left_s !== null ? ` The rig goes back by itself in ${Math.ceil(trial.left_s)} s.` : "";
    at("tried").textContent = trial ? trial.says + left : "";
    if (was && !under) say(trial.says);
    return under;
  };
}
