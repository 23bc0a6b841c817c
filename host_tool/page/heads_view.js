// Draws heads' pictures through their lenses, with three.js: each is a mesh of its own that turns with its head.

import * as three from "./vendor/viewer.js";
import { SphereView } from "./sphere_view.js";

export const kColours = ["#ff5d5d", "#4fc3f7", "#ffd54f", "#81c784", "#ba68c8", "#ff8a65", "#4db6ac", "#f06292",
  "#aed581", "#9fa8da"];
const kMask = "#ff00ff";
const kFeather = 0.12; // of the picture, at its edges, where overlaps are blended

const kVertex = `precision highp float;
in vec3 position;
in vec2 uv;
uniform mat4 projectionMatrix, modelViewMatrix;
out vec2 at;
void main() {
  at = uv;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;
const kFragment = `precision highp float;
in vec2 at;
uniform sampler2D picture;
uniform float opacity, feather;
out vec4 colour;
void main() {
  vec2 edge = min(at, 1.0 - at);
  float weight = feather > 0.0 ? smoothstep(0.0, feather, min(edge.x, edge.y)) : 1.0;
  colour = vec4(texture(picture, at).rgb, opacity * weight);
}`;
const kDifference = `precision highp float;
uniform sampler2D chosen, others;
uniform vec2 size;
out vec4 colour;
void main() {
  vec4 a = texture(chosen, gl_FragCoord.xy / size), b = texture(others, gl_FragCoord.xy / size);
  bool both = a.a > 0.5 && b.a > 0.5;
  colour = vec4(both ? abs(a.rgb - b.rgb) : 0.25 * (a.a > 0.5 ? a.rgb : b.rgb), 1.0);
}`;
const kWhole = `precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

/// The edges that only one triangle has.
function borderOf(geometry) {
  const index = geometry.index.array, count = geometry.getAttribute("position").count, edges = new Map();
  for (let k = 0; k < index.length; k += 3) {
    for (const [a, b] of [[0, 1], [1, 2], [2, 0]]) {
      const p = index[k + a], q = index[k + b], key = Math.min(p, q) * count + Math.max(p, q);
      edges.set(key, (edges.get(key) ?? 0) + 1);
    }
  }
  const points = geometry.getAttribute("position").array, corners = [];
  for (const [key, times] of edges) {
    if (times !== 1) continue;
    for (const p of [Math.floor(key / count), key % count])
      corners.push(...points.slice(3 * p, 3 * p + 3).map((v) => v * 0.99));
  }
  return new Float32Array(corners);
}

/// Drawn after the heads: three.js draws what is transparent last.
function lines(points, colour) {
  const geometry = new three.BufferGeometry();
  geometry.setAttribute("position", new three.BufferAttribute(new Float32Array(points), 3));
  const made = new three.LineSegments(geometry, new three.LineBasicMaterial({ color: colour, depthTest: false, transparent: true }));
  made.frustumCulled = false;
  return made;
}

export class HeadsView extends SphereView {
  constructor(canvas) {
    super(canvas);
    this.mesh = this.texture = {}; // there is something to draw
    this.heads = [];
    this.mode = "blend";
    this.chosen = new Set();
    this.marks = [];
    this.outlines = [];
    const size = { value: [1, 1] };
    this.targets = [0, 1].map(() => new three.WebGLRenderTarget(1, 1));
    this.compare = new three.RawShaderMaterial({
      glslVersion: three.GLSL3, vertexShader: kWhole, fragmentShader: kDifference, depthTest: false, depthWrite: false,
      uniforms: { chosen: { value: this.targets[0].texture }, others: { value: this.targets[1].texture }, size },
    });
    this.compared = new three.Scene();
    const plane = new three.Mesh(new three.PlaneGeometry(2, 2), this.compare);
    plane.frustumCulled = false;
    this.compared.add(plane);
  }

  async addHead(glb, bitmap) {
    const model = await new three.GLTFLoader().parseAsync(glb, "");
    let geometry = null;
    model.scene.traverse((part) => (geometry ??= part.geometry ?? null));
    const texture = this.textureOf(bitmap, false, true);
    texture.needsUpdate = true;
    const part = (feather) => new three.Mesh(geometry, new three.RawShaderMaterial({
      glslVersion: three.GLSL3, vertexShader: kVertex, fragmentShader: kFragment, side: three.DoubleSide,
      transparent: true, depthTest: false, depthWrite: false,
      uniforms: { picture: { value: texture }, opacity: { value: 1 }, feather: { value: feather } },
    }));
    // Under the pictures with soft edges are the same ones with hard edges, for where there is only one.
    const mesh = part(kFeather), base = part(0);
    const border = lines(borderOf(geometry), kColours[this.heads.length % kColours.length]);
    for (const each of [base, mesh, border]) {
      each.matrixAutoUpdate = false;
      each.frustumCulled = false;
      this.scene.add(each);
    }
    this.heads.push({ mesh, base, border });
  }

  /// Another picture of the same size.
  setHeadPicture(k, bitmap) {
    const texture = this.heads[k].mesh.material.uniforms.picture.value;
    texture.image.close?.();
    texture.image = bitmap;
    texture.needsUpdate = true;
    this.cubeIsNew = false;
  }

  /// `axes`: rows of the rotation from the head's axes to the rig's.
  turnHead(k, axes) {
    const [a, b, c, d, e, f, g, h, i] = axes;
    for (const part of Object.values(this.heads[k])) {
      part.matrix.set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
      part.matrixWorldNeedsUpdate = true;
    }
    this.cubeIsNew = false;
  }

  /// `pairs`: two directions and a colour each.
  setPairs(pairs) {
    for (const mark of this.marks) this.scene.remove(mark);
    this.marks = pairs.map(({ a, b, colour }) => {
      const cross = (p) => [[0.004, 0, 0], [0, 0.004, 0], [0, 0, 0.004]]
        .flatMap((step) => [p.map((v, n) => 0.97 * v - step[n]), p.map((v, n) => 0.97 * v + step[n])]);
      return lines([...cross(a), ...cross(b), a.map((v) => 0.97 * v), b.map((v) => 0.97 * v)].flat(), colour);
    });
    for (const mark of this.marks) {
      mark.renderOrder = 1000;
      this.scene.add(mark);
    }
    this.cubeIsNew = false;
  }

  /// `outlines`: lists of directions, each drawn as one line.
  setOutlines(outlines) {
    for (const outline of this.outlines) this.scene.remove(outline);
    this.outlines = outlines.map((points) => lines(points.slice(1).flatMap((point, k) =>
      [...points[k], ...point].map((v) => 0.97 * v)), kMask));
    for (const outline of this.outlines) {
      outline.renderOrder = 1000;
      this.scene.add(outline);
    }
    this.cubeIsNew = false;
  }

  /// Which heads are drawn, the chosen ones last, so that they are on top.
  arrange(shown, opacity, feather) {
    this.heads.forEach(({ mesh, base, border }, k) => {
      const chosen = this.chosen.has(k);
      mesh.visible = shown(k);
      base.visible = feather > 0;
      base.renderOrder = k;
      mesh.renderOrder = chosen ? 500 + k : 100 + k;
      border.renderOrder = 900;
      border.visible = chosen || this.chosen.size === 0;
      mesh.material.uniforms.opacity.value = opacity(chosen);
      mesh.material.uniforms.feather.value = feather;
    });
  }

  draw(camera) {
    this.cubeIsNew = false;
    const half = this.mode === "half";
    this.arrange(() => true, (chosen) => (half && chosen ? 0.5 : 1), half ? 0 : kFeather);
    const compares = this.mode === "difference" && camera.projection === "perspective" && this.chosen.size > 0;
    if (!compares) return super.draw(camera);
    const ratio = this.renderer.getPixelRatio(), width = camera.width * ratio, height = camera.height * ratio;
    this.compare.uniforms.size.value = [width, height];
    const background = this.renderer.getClearAlpha();
    for (const [n, target] of this.targets.entries()) {
      target.setSize(width, height);
      this.arrange((k) => this.chosen.has(k) === (n === 0), () => 1, 0);
      for (const { border } of this.heads) border.visible = false;
      for (const mark of [...this.marks, ...this.outlines]) mark.visible = false;
      this.renderer.setRenderTarget(target);
      this.renderer.setClearAlpha(0);
      super.draw(camera);
    }
    this.renderer.setClearAlpha(background);
    this.renderer.setRenderTarget(null);
    for (const mark of [...this.marks, ...this.outlines]) mark.visible = true;
    this.renderer.render(this.compared, this.flatEye);
  }
}
