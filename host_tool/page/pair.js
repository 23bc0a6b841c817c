// Pairs this device: the code stands in the fragment of the link and is sent only when the button is pressed, so that
// programs that open links beforehand do not use it up.

const at = (id) => document.getElementById(id);
const code = location.hash.slice(1);

async function pair(event) {
  event.preventDefault();
  at("pair").disabled = true;
  try {
    const answer = await fetch("api/pair", {
      method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ code, name: at("name").value.trim() }),
    });
    if (!answer.ok) throw new Error(await answer.text());
    location.replace("./");
  } catch (error) {
    at("say").textContent = `Not paired: ${error.message}.`;
    at("pair").disabled = false;
  }
}

history.replaceState(null, "", location.pathname); // the code does not stay in the address bar
if (/^[0-9a-f]{32}$/.test(code)) {
  at("say").textContent = "Press the button to pair this phone, tablet or computer. The link is good once.";
  at("form").hidden = false;
  at("form").addEventListener("submit", pair);
} else {
  at("say").textContent = "This device is not paired with the rig. Whoever looks after the rig makes a link for it: " +
    "nodal-web pair.";
}
