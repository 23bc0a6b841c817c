// The takes on the rig's disk: thumbnails, gaps, files to download, protection.

const kEvery = 5000; // ms, between two questions for the list
const at = (id) => document.getElementById(id);
const megabytes = (bytes) => (bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`);

function element(name, text, more = {}) {
  const made = document.createElement(name);
  made.textContent = text;
  return Object.assign(made, more);
}

function words(take) {
  const missing = take.lost_sets + take.not_captured;
  const gaps = missing ? `, ${missing} sets missing in ${take.gaps} gaps` : "";
  const why = take.ended && take.ended !== "stopped" ? `, ${take.ended}` : "";
  return `Take ${take.take}: ${(take.length_ns / 1e9).toFixed(1)} s, ${take.sets} sets${gaps}, ${megabytes(take.bytes)}, ` +
    `${take.state}${why}${take.protected ? ", protected" : ""}`;
}

/// Lists the files when the list is opened.
function filesOf(take, ask) {
  const details = document.createElement("details"), list = document.createElement("ul");
  details.append(element("summary", `Files of take ${take.take}`), list);
  details.addEventListener("toggle", async () => {
    if (!details.open || list.children.length > 0) return;
    try {
      const { files } = await (await ask(`takes/${take.take}`)).json();
      list.replaceChildren(...files.map((file) => {
        const item = document.createElement("li");
        item.append(element("a", file.name, { href: `takes/${take.take}/${file.name}`, download: "" }),
          ` ${megabytes(file.bytes)}`);
        item.title = `XXH3-128 of its pieces: ${file.xxh3_128_of_pieces}`;
        return item;
      }));
    } catch (error) {
      list.replaceChildren(element("li", error.message));
    }
  });
  return details;
}

function itemOf(take, ask, order, operates) {
  const item = document.createElement("li");
  item.dataset.take = take.take;
  item.append(element("p", words(take)));
  if (take.state !== "complete") return item;
  if (take.width > 0)
    item.append(element("img", "", { src: `thumbs/${take.take}`, alt: `The sphere of take ${take.take}`, loading: "lazy" }));
  if (!operates) return item;
  const protect = element("button", take.protected ? "Unprotect" : "Protect", { type: "button" });
  protect.setAttribute("aria-label", `${protect.textContent} take ${take.take}`);
  protect.addEventListener("click", async () => {
    protect.disabled = true;
    await order("api/protect", { take: take.take, on: !take.protected }).catch((error) => {
      at("said").textContent = `Not done: ${error.message}`;
    });
    await read(ask, order, operates);
  });
  item.append(protect, filesOf(take, ask));
  return item;
}

const shown = new Map(); // by number: words and item

async function read(ask, order, operates) {
  const { takes } = await (await ask("api/takes")).json();
  const items = takes.reverse().map((take) => {
    const text = JSON.stringify(take), before = shown.get(take.take);
    if (before?.text === text) return before.item; // stays as it is: open lists, the focus
    const item = itemOf(take, ask, order, operates);
    const files = item.querySelector("details");
    if (files) files.open = before?.item.querySelector("details")?.open ?? false;
    shown.set(take.take, { text, item });
    return item;
  });
  const list = at("takes");
  if (items.length !== list.children.length || items.some((item, k) => item !== list.children[k]))
    list.replaceChildren(...items);
  at("no-takes").hidden = items.length > 0;
}

export function connectTakes(ask, order, operates) {
  const again = async () => {
    try {
      if (!document.hidden) await read(ask, order, operates);
    } catch {
      // The state says that the rig is gone; the list stays.
    }
    setTimeout(again, kEvery);
  };
  again();
}
