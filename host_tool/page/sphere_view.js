// Draws the raymap's triangles as the camera sees them, with three.js.

import * as three from "./vendor/viewer.js";
import { scatter, split } from "./mesh_split.js";
import { projections } from "./projection.js";

// A perspective view is drawn directly. Other projections bend straight lines, so the surroundings of the eye are drawn
// on the six faces of a cube, and each pixel looks up its own direction there.
const kLookUp = `precision highp float;
uniform samplerCube around;
uniform mat3 turn;
uniform vec2 middle;
uniform float focal;
uniform int projection;
out vec4 colour;
void main() {
  vec2 at = gl_FragCoord.xy - middle;
  float far = length(at);
  float angle = projection == 1 ? far / focal : 2.0 * atan(far / focal / 2.0);
  vec3 ray = far == 0.0 ? vec3(0.0, 0.0, -1.0) : vec3(sin(angle) * at / far, -cos(angle));
  colour = angle > 3.14159265 ? vec4(0.0, 0.0, 0.0, 1.0) : vec4(texture(around, turn * ray).rgb, 1.0);
}`;
const kHeadsetRadius = 1000; // m, of the sphere in a headset
const kFewCorners = 6000; // a mesh with more has no large triangles
const kWhole = `precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

export class SphereView {
  /// Throws where there is no WebGL.
  constructor(canvas) {
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: false });
    this.renderer.outputColorSpace = three.LinearSRGBColorSpace; // levels of the picture are shown as they are
    this.renderer.toneMapping = three.NoToneMapping;
    this.scene = new three.Scene();
    this.eye = new three.PerspectiveCamera(90, 1, 0.001, 100);
    this.material = new three.MeshBasicMaterial({ side: three.DoubleSide });
    this.mesh = null;
    this.radius = 1;
    this.texture = null;
    this.turn = new three.Matrix3();
    this.lookUp = new three.RawShaderMaterial({
      glslVersion: three.GLSL3, vertexShader: kWhole, fragmentShader: kLookUp, depthTest: false, depthWrite: false,
      uniforms: {
        around: { value: null }, turn: { value: this.turn }, middle: { value: [0, 0] }, focal: { value: 1 },
        projection: { value: 0 },
      },
    });
    this.whole = new three.Scene();
    const plane = new three.Mesh(new three.PlaneGeometry(2, 2), this.lookUp);
    plane.frustumCulled = false;
    this.whole.add(plane);
    this.flatEye = new three.OrthographicCamera(-1, 1, 1, -1, 0, 1);
    this.cube = null;
    this.cubeIsNew = false; // as seen from cube.position
  }

  get largestPicture() {
    return this.renderer.capabilities.maxTextureSize;
  }

  /// `even`: rows and columns go on smoothly, so that smaller copies of the picture may be used where it is shown
  /// small.
  /// `moving`: others of the same size follow.
  setPicture(bitmap, even, moving = false) {
    const before = this.texture?.image;
    if (before && moving && before.width === bitmap.width && before.height === bitmap.height) {
      this.texture.image = bitmap; // its memory is used again
      before.close?.();
    } else {
      this.texture?.dispose();
      this.texture = this.textureOf(bitmap, even, moving);
      this.material.map = this.texture;
      this.material.needsUpdate = true;
    }
    this.texture.needsUpdate = true;
    this.cubeIsNew = false;
  }

  textureOf(bitmap, even, moving) {
    const texture = new three.Texture(bitmap);
    texture.flipY = false;
    texture.colorSpace = three.NoColorSpace;
    texture.generateMipmaps = even && !moving; // they take longer than the picture
    texture.minFilter = texture.generateMipmaps ? three.LinearMipmapLinearFilter : three.LinearFilter;
    texture.magFilter = three.LinearFilter;
    texture.wrapS = even ? three.RepeatWrapping : three.ClampToEdgeWrapping;
    texture.anisotropy = even ? Math.min(8, this.renderer.capabilities.getMaxAnisotropy()) : 1;
    return texture;
  }

  /// `bytes`: a .glb. `loose`: each triangle is moved along its rays to a distance of its own, so that from the nodal
  /// point nothing changes.
  async setMesh(bytes, loose = false) {
    const model = await new three.GLTFLoader().parseAsync(bytes, "");
    let geometry = null;
    model.scene.traverse((part) => (geometry ??= part.geometry ?? null));
    if (loose) geometry = this.looseTriangles(geometry);
    else if (geometry.index.count < kFewCorners) geometry = this.smallTriangles(geometry);
    if (this.mesh) {
      this.scene.remove(this.mesh);
      this.mesh.geometry.dispose();
    }
    this.mesh = new three.Mesh(geometry, this.material);
    this.mesh.frustumCulled = false;
    this.scene.add(this.mesh);
    const points = geometry.getAttribute("position");
    let far = 0;
    for (let k = 0; k < points.count; ++k)
      far = Math.max(far, Math.hypot(points.getX(k), points.getY(k), points.getZ(k)));
    this.radius = far;
    this.cubeIsNew = false;
  }

  smallTriangles(geometry) {
    const apart = geometry.toNonIndexed();
    const { points, textures } = split(apart.getAttribute("position").array, apart.getAttribute("uv").array);
    const made = new three.BufferGeometry();
    made.setAttribute("position", new three.BufferAttribute(points, 3));
    made.setAttribute("uv", new three.BufferAttribute(textures, 2));
    return made;
  }

  looseTriangles(geometry) {
    const apart = geometry.toNonIndexed();
    scatter(apart.getAttribute("position").array);
    return apart;
  }

  resize(width, height) {
    Object.assign(this, { width, height });
    if (this.renderer.xr.isPresenting) return;
    this.renderer.setPixelRatio(Math.min(2, globalThis.devicePixelRatio || 1));
    this.renderer.setSize(width, height); // also as CSS has it
  }

  /// Draws for a headset until leave(). The sphere is so large that neither the distance between the eyes nor steps
  /// change what is seen, and begins where the camera looks.
  async enter(session, camera) {
    const { xr } = this.renderer;
    xr.enabled = true;
    xr.setReferenceSpaceType("local");
    await xr.setSession(session);
    this.mesh.scale.setScalar(kHeadsetRadius / this.radius);
    this.mesh.rotation.y = (camera.yaw * Math.PI) / 180;
    const eye = new three.PerspectiveCamera(90, 1, 1, 2 * kHeadsetRadius);
    this.renderer.setAnimationLoop(() => this.renderer.render(this.scene, eye));
  }

  leave() {
    this.renderer.setAnimationLoop(null);
    this.renderer.xr.enabled = false;
    this.mesh.scale.setScalar(1);
    this.mesh.rotation.y = 0;
    this.cubeIsNew = false;
    this.resize(this.width, this.height);
  }

  draw(camera) {
    if (!this.mesh || !this.texture || this.renderer.xr.isPresenting) return;
    const distance = camera.distance * this.radius;
    this.eye.rotation.order = "YXZ";
    this.eye.rotation.set((camera.pitch * Math.PI) / 180, (-camera.yaw * Math.PI) / 180, (-camera.roll * Math.PI) / 180);
    if (distance > 0) this.eye.position.set(0, 0, distance).applyEuler(this.eye.rotation);
    else this.eye.position.fromArray(camera.eye);
    this.eye.near = this.radius * 0.001;
    this.eye.far = distance + 2 * this.radius;
    if (camera.projection === "perspective") {
      this.eye.aspect = camera.width / camera.height;
      this.eye.fov = (2 * Math.atan(camera.height / 2 / camera.focal) * 180) / Math.PI;
      this.eye.updateProjectionMatrix();
      this.renderer.render(this.scene, this.eye);
      return;
    }
    this.drawAround(camera);
    this.eye.updateMatrixWorld();
    this.turn.setFromMatrix4(this.eye.matrixWorld);
    const ratio = this.renderer.getPixelRatio();
    const { uniforms } = this.lookUp;
    uniforms.around.value = this.cube.renderTarget.texture;
    uniforms.middle.value = [(camera.width * ratio) / 2, (camera.height * ratio) / 2];
    uniforms.focal.value = camera.focal * ratio;
    uniforms.projection.value = projections[camera.projection].number;
    this.renderer.render(this.whole, this.flatEye);
  }

  /// The surroundings of the eye. Inside they stay the same while the camera turns.
  drawAround(camera) {
    const wanted = 2.6 * camera.focal * this.renderer.getPixelRatio();
    const side = Math.min(2048, this.largestPicture, 2 ** Math.ceil(Math.log2(Math.max(256, wanted))));
    if (this.cube?.renderTarget.width !== side) {
      this.cube?.renderTarget.dispose();
      this.cube = new three.CubeCamera(0.001, 100, new three.WebGLCubeRenderTarget(side));
      this.cubeIsNew = false;
    }
    if (this.cubeIsNew && this.cube.position.equals(this.eye.position)) return;
    for (const face of this.cube.children) {
      face.near = this.eye.near;
      face.far = this.eye.far;
      face.updateProjectionMatrix();
    }
    this.cube.position.copy(this.eye.position);
    this.cube.update(this.renderer, this.scene);
    this.cubeIsNew = true;
  }
}
