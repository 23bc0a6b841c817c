// Rotations of heads, as the page slides them. Rows of 3 x 3 matrices; vectors of rotation are rad about an axis.

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const scaled = (a, s) => a.map((v) => v * s);

/// The smallest rotation that brings one direction to another.
export function between(from, to) {
  const axis = cross(from, to), sine = Math.hypot(...axis);
  return sine < 1e-12 ? [0, 0, 0] : scaled(axis, Math.atan2(sine, dot(from, to)) / sine);
}

/// The matrix of a rotation (Rodrigues), applied to `axes`, which are rows of a matrix.
export function turnedAxes(about, axes) {
  const angle = Math.hypot(...about);
  if (angle === 0) return axes;
  const k = scaled(about, 1 / angle), s = Math.sin(angle), c = Math.cos(angle);
  const turned = (v) => {
    const side = cross(k, v), along = dot(k, v) * (1 - c);
    return v.map((value, n) => value * c + side[n] * s + k[n] * along);
  };
  const columns = [0, 1, 2].map((n) => turned([axes[n], axes[3 + n], axes[6 + n]]));
  return [0, 1, 2].flatMap((row) => columns.map((column) => column[row]));
}
