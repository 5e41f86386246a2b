// What a snapshot means in the pictures: where points land, what colours they have, how these differ.

const isSeen = (visible, point) => (visible[point >> 3] >> (point & 7)) & 1;

/** Where every point lands in a frame, u v by turns, in the sequence's pixels (the first one's centre: 0.5). */
function project(cloud, pose, focal, center) {
  const pixels = new Float32Array((cloud.length / 3) * 2);
  for (let i = 0, j = 0; i < cloud.length; i += 3, j += 2) {
    const [x, y, z] = [cloud[i], cloud[i + 1], cloud[i + 2]];
    const depth = pose[8] * x + pose[9] * y + pose[10] * z + pose[11];
    pixels[j] = (focal[0] * (pose[0] * x + pose[1] * y + pose[2] * z + pose[3])) / depth + center[0];
    pixels[j + 1] = (focal[1] * (pose[4] * x + pose[5] * y + pose[6] * z + pose[7])) / depth + center[1];
  }
  return pixels;
}

/** I(u): the colour at a subpixel in [0, 255], into `out` from `at` on. */
function sampleBilinear(frame, size, u, v, out, at) {
  const { width, height, pixels } = frame;
  const x = Math.min(Math.max((u * width) / size[0] - 0.5, 0), width - 1);
  const y = Math.min(Math.max((v * height) / size[1] - 0.5, 0), height - 1);
  const [x0, y0] = [Math.floor(x), Math.floor(y)];
  const [fx, fy] = [x - x0, y - y0];
  const right = x0 + 1 < width ? 4 : 0;
  const below = y0 + 1 < height ? 4 * width : 0;
  const i = 4 * (y0 * width + x0);
  for (let c = 0; c < 3; c++) {
    const upper = pixels[i + c] * (1 - fx) + pixels[i + right + c] * fx;
    const lower = pixels[i + below + c] * (1 - fx) + pixels[i + below + right + c] * fx;
    out[at + c] = upper * (1 - fy) + lower * fy;
  }
}

/**
 * Measures one snapshot.
 *
 * `colors` are means over the frames that see a point, in [0, 255]. A residual is the difference in colour
 * from the reference frame, the mean of its channels' sizes in [0, 1]: `residuals[l]` in frame l, NaN unless
 * both see the point, and `residual` the mean over frames. Frame 0, which is the reference, has that mean.
 */
function measure(report, snapshot) {
  const { frames, size, center, exposures } = report;
  const { cloud, visible, poses, focal } = snapshot;
  const n = cloud.length / 3;
  const colors = new Float32Array(3 * n);
  const counts = new Uint16Array(n);
  const reference = new Float32Array(3 * n);
  const sample = new Float32Array(3);
  const sums = new Float32Array(n);
  const pairs = new Uint16Array(n);
  const pixels = [];
  const residuals = [];
  frames.forEach((frame, l) => {
    const at = project(cloud, poses[l], focal, center);
    const residual = new Float32Array(n).fill(NaN);
    const { gain, bias } = (l > 0 && exposures && exposures[l - 1]) || { gain: 1, bias: 0 };
    for (let i = 0; i < n; i++) {
      if (!isSeen(visible[l], i)) continue;
      sampleBilinear(frame, size, at[2 * i], at[2 * i + 1], sample, 0);
      counts[i]++;
      for (let c = 0; c < 3; c++) colors[3 * i + c] += sample[c];
      if (l === 0) {
        reference.set(sample, 3 * i);
      } else if (isSeen(visible[0], i)) {
        let size = 0;
        for (let c = 0; c < 3; c++) size += Math.abs(reference[3 * i + c] - gain * sample[c] - 255 * bias);
        residual[i] = size / 765;
        sums[i] += residual[i];
        pairs[i]++;
      }
    }
    pixels.push(at);
    residuals.push(residual);
  });
  const residual = sums.map((sum, i) => (pairs[i] ? sum / pairs[i] : NaN));
  residuals[0] = residual;
  for (let i = 0; i < n; i++) {
    if (counts[i]) for (let c = 0; c < 3; c++) colors[3 * i + c] /= counts[i];
  }
  return { pixels, colors, counts, residual, residuals };
}

/** Measurements of the snapshots shown last: one takes some 30 ms, and 5 MB with 15 frames. */
class Measurements {
  constructor(report) {
    this.report = report;
    this.kept = new Map();
  }

  of(snapshot) {
    const found = this.kept.get(snapshot) ?? measure(this.report, snapshot);
    this.kept.delete(snapshot);
    this.kept.set(snapshot, found);
    if (this.kept.size > 6) this.kept.delete(this.kept.keys().next().value);
    return found;
  }
}
