// The part of a report that turns a sphere: JavaScript and WebGL in the page itself, so that it works from a disk.
#pragma once

namespace nodal::host {

/// Turns each `figure.sphere`: its picture is a part of an equirectangular sphere, data-part="left,top,width,height" as
/// shares of the whole. Without WebGL the flat picture stays.
inline constexpr const char* kSphereScript = R"js(
for (const figure of document.querySelectorAll("figure.sphere")) {
  const image = figure.querySelector("img");
  const part = figure.dataset.part.split(",").map(Number);
  const canvas = document.createElement("canvas");
  const gl = canvas.getContext("webgl");
  if (!gl) continue;
  const limit = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  const start = {
    yaw: (part[0] + part[2] / 2 - 0.5) * 2 * Math.PI,
    pitch: (0.5 - part[1] - part[3] / 2) * Math.PI,
    fov: Math.min(75, Math.max(part[2] * 360, part[3] * 180)) * Math.PI / 180,
  };
  const view = { ...start };
  const shader = (kind, text) => {
    const made = gl.createShader(kind);
    gl.shaderSource(made, text);
    gl.compileShader(made);
    return made;
  };
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER,
    "attribute vec2 at; varying vec2 p; void main() { p = at; gl_Position = vec4(at, 0.0, 1.0); }"));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `
    precision highp float;
    varying vec2 p;
    uniform sampler2D sphere;
    uniform vec4 part;
    uniform vec4 camera; // yaw, pitch, half of the view in each direction at distance 1
    void main() {
      vec3 d = normalize(vec3(p * camera.zw, 1.0)); // right, up, forward
      float c = cos(camera.y), s = sin(camera.y);
      d = vec3(d.x, d.y * c + d.z * s, d.z * c - d.y * s);
      float u = fract((atan(d.x, d.z) + camera.x) / 6.28318531 + 0.5);
      float v = 0.5 - asin(clamp(d.y, -1.0, 1.0)) / 3.14159265;
      vec2 t = vec2(fract(u - part.x), v - part.y) / part.zw; // a part may go on at the left edge
      bool seen = all(greaterThanEqual(t, vec2(0.0))) && all(lessThanEqual(t, vec2(1.0)));
      gl_FragColor = seen ? vec4(texture2D(sphere, t).rgb, 1.0) : vec4(0.2, 0.2, 0.2, 1.0);
    }`));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) continue;
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
  gl.enableVertexAttribArray(gl.getAttribLocation(program, "at"));
  gl.vertexAttribPointer(gl.getAttribLocation(program, "at"), 2, gl.FLOAT, false, 0, 0);
  gl.uniform4fv(gl.getUniformLocation(program, "part"), part);
  const camera = gl.getUniformLocation(program, "camera");
  const draw = () => {
    const scale = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * scale);
    canvas.height = Math.round(canvas.clientHeight * scale);
    gl.viewport(0, 0, canvas.width, canvas.height);
    const half = Math.tan(view.fov / 2), aspect = canvas.height / canvas.width;
    gl.uniform4f(camera, view.yaw, view.pitch, half, half * aspect);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  };
  const turn = (yaw, pitch) => {
    view.yaw = (view.yaw + yaw) % (2 * Math.PI);
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch));
    draw();
  };
  const zoom = (factor) => {
    view.fov = Math.max(0.1, Math.min(2.1, view.fov * factor));
    draw();
  };
  const reset = () => {
    Object.assign(view, start);
    draw();
  };

  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "The sphere. Drag it, or use the arrow keys; plus and minus change the view.");
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    const angle = 2 * Math.tan(view.fov / 2) / canvas.clientWidth; // seen by a pixel in the middle
    turn(-event.movementX * angle, event.movementY * angle);
  });
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page scrolls
    event.preventDefault();
    zoom(Math.exp(event.deltaY / 500));
  }, { passive: false });
  const step = Math.PI / 36;
  const keys = {
    ArrowLeft: () => turn(-step, 0), ArrowRight: () => turn(step, 0), ArrowUp: () => turn(0, step),
    ArrowDown: () => turn(0, -step), "+": () => zoom(0.8), "=": () => zoom(0.8), "-": () => zoom(1.25), Home: reset,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });

  const tools = document.createElement("div");
  tools.className = "tools";
  const button = (text, name, action) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    if (name) made.setAttribute("aria-label", name);
    made.addEventListener("click", action);
    tools.append(made);
    return made;
  };
  button("+", "Closer", () => zoom(0.8));
  button("−", "Farther", () => zoom(1.25));
  button("Reset", "", reset);
  const flat = button("Flat picture", "", () => show(!canvas.hidden));
  const show = (asPicture) => {
    image.hidden = !asPicture;
    canvas.hidden = asPicture;
    flat.textContent = asPicture ? "Sphere" : "Flat picture";
    if (!asPicture) draw();
  };
  canvas.addEventListener("webglcontextlost", () => {
    tools.remove();
    show(true);
  });
  image.decode().then(() => {
    if (Math.max(image.naturalWidth, image.naturalHeight) > limit) return;
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
    figure.prepend(canvas);
    figure.querySelector("figcaption").before(tools);
    show(false);
    new ResizeObserver(() => canvas.hidden || draw()).observe(canvas);
    figure.dataset.ready = "true";
  }).catch(() => {});
}
)js";

}  // namespace nodal::host
