// Shows the raymaps of a running rig: asks for the newest one again and again, says how old it is, and turns the
// picture grey when it is old. No drawing.

const kAgain = 15; // ms, until the next question when there was no newer picture
const kOld = 2000; // ms: the picture is shown grey
const kLate = 100; // ms, between two looks at the age

/// `setPicture(bitmap)` draws; `say(text)` tells people; `stage` gets the class "old".
export function watchRig(setPicture, say, stage, output) {
  const asStored = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
  let number = 0, exposed = null, of = "", problem = "", pictures = 0, said = false;

  const next = async () => {
    let newer = false;
    try {
      const answer = await fetch(`live?after=${number}`);
      problem = answer.headers.get("X-Problem") ?? "";
      if (answer.status === 200) {
        const moment = performance.now() - Number(answer.headers.get("X-Age-Ms"));
        setPicture(await createImageBitmap(await answer.blob(), asStored));
        number = Number(answer.headers.get("X-Number"));
        of = answer.headers.get("X-Age-Of");
        exposed = moment;
        ++pictures;
        newer = true;
      }
    } catch {
      problem = "the program has ended";
    }
    setTimeout(next, newer ? 0 : document.hidden ? 500 : kAgain);
  };
  const look = () => {
    if (exposed === null) return;
    const age = performance.now() - exposed, old = age > kOld;
    stage.classList.toggle("old", old);
    const seconds = (age / 1000).toFixed(age < 10000 ? 2 : 0);
    output.textContent = `picture ${seconds} s old${of === "arrival" ? " since it came" : ""}`;
    Object.assign(output.dataset, { age: Math.round(age), pictures, number });
    const why = problem || "no newer picture came";
    if (old) say(`The rig is gone or stands still: ${why}. The picture is ${seconds} s old.`);
    else if (said) say("");
    said = old;
  };
  next();
  setInterval(look, kLate);
}
