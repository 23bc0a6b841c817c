// A camera path of keys, as the lines that `nodal view --path` reads.

const kPictures = 60; // from key to key of a single sphere: two seconds at 30 pictures a second

export class PathKeys {
  constructor() {
    this.keys = [];
  }

  /// `picture`: that of a film; null: of a single sphere, whose keys follow each other evenly. A second key of the same
  /// picture replaces the first one.
  add(camera, picture) {
    const at = picture ?? this.keys.length * kPictures;
    this.keys = this.keys.filter((key) => key.picture !== at);
    this.keys.push({ picture: at, yaw: camera.yaw, pitch: camera.pitch, roll: camera.roll, fov: camera.fov });
    this.keys.sort((a, b) => a.picture - b.picture);
  }

  /// Angles go on beyond a turn, so that the camera takes the shorter way.
  lines() {
    const number = (value) => Number(value.toFixed(4));
    let before = null;
    const rows = this.keys.map(({ picture, yaw, pitch, roll, fov }) => {
      before = before === null ? yaw : yaw + 360 * Math.round((before - yaw) / 360);
      return `${picture},${number(before)},${number(pitch)},${number(roll)},${number(fov)}\n`;
    });
    return ["picture,yaw,pitch,roll,fov\n", ...rows].join("");
  }
}

/// Gives the action of the key K. `shown()`: the number of a film's picture, or null.
export function connectPath(camera, at, shown) {
  const keys = new PathKeys();
  const show = () => {
    at("path").textContent = keys.lines();
    at("path-saved").href = URL.createObjectURL(new Blob([keys.lines()], { type: "text/csv" }));
    at("path-box").hidden = keys.keys.length === 0;
  };
  at("path-clear").addEventListener("click", () => { keys.keys = []; show(); });
  const add = () => { keys.add(camera, shown()); show(); };
  at("path-add").addEventListener("click", add);
  return add;
}
