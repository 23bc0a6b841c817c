// Triangles cut into smaller ones that lie in them. What is drawn stays the same, but software graphics (SwiftShader)
// draw a triangle in one colour that has a corner exactly beside the eye, at 90 degrees from the axis. Small triangles
// that are seen have none there.

const kLongest = 10; // degrees, of an edge as the centre sees it
const kMaxCuts = 5;

function angle(points, a, b) {
  const at = (k) => points.slice(3 * k, 3 * k + 3);
  const p = at(a), q = at(b);
  const cross = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
  return (Math.atan2(Math.hypot(...cross), p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) * 180) / Math.PI;
}

function longestEdge(points) {
  let longest = 0;
  for (let k = 0; k < points.length / 3; k += 3)
    longest = Math.max(longest, angle(points, k, k + 1), angle(points, k + 1, k + 2), angle(points, k + 2, k));
  return longest;
}

/// Each triangle as four, of values with `size` numbers a corner, three corners a triangle.
function cutInFour(values, size) {
  const made = new Float32Array(values.length * 4);
  let to = 0;
  for (let from = 0; from < values.length; from += 3 * size) {
    const corner = (k) => values.subarray(from + k * size, from + (k + 1) * size);
    const middle = (k, j) => corner(k).map((value, n) => (value + corner(j)[n]) / 2);
    const [a, b, c] = [0, 1, 2].map(corner);
    const ab = middle(0, 1), bc = middle(1, 2), ca = middle(2, 0);
    for (const part of [a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]) {
      made.set(part, to);
      to += size;
    }
  }
  return made;
}

/// `points` (three numbers a corner) and `textures` (two), three corners a triangle, with short edges.
export function split(points, textures) {
  for (let cuts = 0; cuts < kMaxCuts && longestEdge(points) > kLongest; ++cuts) {
    points = cutInFour(points, 3);
    textures = cutInFour(textures, 2);
  }
  return { points, textures };
}

/// Moves each triangle along the rays of its corners to 0.7 to 1.3 times its distance, at random but always alike:
/// a soup of triangles. `points`: nine numbers a triangle.
export function scatter(points) {
  let state = 1;
  for (let at = 0; at < points.length; at += 9) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0; // Numerical Recipes' generator
    const factor = 0.7 + (0.6 * state) / 2 ** 32;
    for (let k = 0; k < 9; ++k) points[at + k] *= factor;
  }
}
