// Where a camera shows a ray, as `nodal view --camera` has it: the distance from the picture's centre, in focal
// lengths, by the angle from the axis. Axes of a camera: x right, y up, z backward, as graphics have them.

export const kDegree = Math.PI / 180;

export const projections = {
  perspective: { number: 0, widest: 150, usual: 75, distance: Math.tan, angle: Math.atan },
  fisheye: { number: 1, widest: 360, usual: 180, distance: (a) => a, angle: (r) => r },
  stereographic: {
    number: 2, widest: 340, usual: 300, distance: (a) => 2 * Math.tan(a / 2), angle: (r) => 2 * Math.atan(r / 2),
  },
};

/// Focal length in px, of a picture that is `width` px wide and `fov` degrees from its left to its right edge.
export function focalLength(projection, fov, width) {
  return width / 2 / projections[projection].distance((fov / 2) * kDegree);
}

/// The direction that a camera shows at a point, px to the right of and above the picture's centre; null beyond 180
/// degrees from the axis.
export function rayAt(projection, focal, right, up) {
  const length = Math.hypot(right, up);
  if (length === 0) return [0, 0, -1];
  const angle = projections[projection].angle(length / focal);
  if (angle > Math.PI) return null;
  const s = Math.sin(angle) / length;
  return [s * right, s * up, -Math.cos(angle)];
}

/// A vector of the camera's axes in the sphere's. Yaw to the right, pitch up, degrees.
export function turned([x, y, z], yaw, pitch) {
  const cp = Math.cos(pitch * kDegree), sp = Math.sin(pitch * kDegree);
  const cy = Math.cos(yaw * kDegree), sy = Math.sin(yaw * kDegree);
  const level = [x, y * cp - z * sp, y * sp + z * cp];
  return [level[0] * cy - level[2] * sy, level[1], level[0] * sy + level[2] * cy];
}

/// A vector of a camera that is rolled clockwise, in degrees, in the axes that it has without the roll.
export function rolled([x, y, z], roll) {
  const c = Math.cos(roll * kDegree), s = Math.sin(roll * kDegree);
  return [x * c + y * s, y * c - x * s, z];
}

/// A vector of the sphere's axes in the camera's.
export function unturned([x, y, z], yaw, pitch) {
  const cp = Math.cos(pitch * kDegree), sp = Math.sin(pitch * kDegree);
  const cy = Math.cos(yaw * kDegree), sy = Math.sin(yaw * kDegree);
  const level = [x * cy + z * sy, y, -x * sy + z * cy];
  return [level[0], level[1] * cp + level[2] * sp, -level[1] * sp + level[2] * cp];
}

/// The yaw and pitch by which a camera's vector becomes `goal`, as near to `pitch` as there is one; where there is
/// none, the one that comes nearest.
export function turnTo(vector, goal, pitch) {
  const [x, y, z] = vector;
  const reach = Math.hypot(y, z);
  const height = Math.max(-1, Math.min(1, goal[1] / (reach || 1)));
  const middle = Math.atan2(-z, y), off = Math.acos(height);
  const best = [middle + off, middle - off]
    .map((p) => Math.atan2(Math.sin(p), Math.cos(p)) / kDegree)
    .map((p) => Math.max(-90, Math.min(90, p)))
    .sort((a, b) => Math.abs(a - pitch) - Math.abs(b - pitch))[0];
  const at = turned(vector, 0, best);
  const yaw = (Math.atan2(goal[0], -goal[2]) - Math.atan2(at[0], -at[2])) / kDegree;
  return { yaw: wrapped(yaw), pitch: best };
}

/// Degrees from -180 to 180.
export function wrapped(degrees) {
  return degrees - 360 * Math.round(degrees / 360);
}

/// Where a ray from an eye meets the sphere of radius 1 about the centre, `distance` before the eye on its axis, as a
/// unit vector from the centre; a ray beside it: the point of the rim that is nearest.
export function metSphere(ray, distance) {
  const along = -distance * ray[2];
  const beside = distance * distance - along * along;
  const t = along - Math.sqrt(Math.max(0, 1 - beside));
  const point = [ray[0] * t, ray[1] * t, ray[2] * t + distance];
  const length = Math.hypot(...point);
  return point.map((p) => p / length);
}
