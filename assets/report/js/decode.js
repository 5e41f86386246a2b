'use strict';
// Arrays and pictures out of the page's own text.

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** Numbers in [0, 1], stored as 16 bits each, least byte first. */
function sharesOf(base64) {
  const bytes = bytesOf(base64);
  const shares = new Float32Array(bytes.length / 2);
  for (let i = 0; i < shares.length; i++) shares[i] = (bytes[2 * i] + 256 * bytes[2 * i + 1]) / 65535;
  return shares;
}

/** Points in world units, x y z by turns. */
function cloudOf(base64, [least, most]) {
  const points = sharesOf(base64);
  for (let i = 0; i < points.length; i++) {
    const axis = i % 3;
    points[i] = least[axis] + points[i] * (most[axis] - least[axis]);
  }
  return points;
}

/** A frame's picture, ready to be drawn and to be read. */
async function loadFrame(frame) {
  const image = new Image();
  image.src = frame.picture;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  const context = canvas.getContext('2d', { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const { data, width, height } = context.getImageData(0, 0, canvas.width, canvas.height);
  return { name: frame.name, image, pixels: data, width, height, outline: sharesOf(frame.outline) };
}

/** The report with its arrays; a snapshot's are made when it is first shown. */
async function decodeReport(data) {
  const frames = await Promise.all(data.frames.map(loadFrame));
  const snapshots = data.snapshots.map((stored) => {
    const snapshot = { step: stored.step, poses: stored.poses, focal: stored.focal };
    const once = (name, make) => {
      const get = () => {
        const value = make();
        Object.defineProperty(snapshot, name, { value });
        return value;
      };
      Object.defineProperty(snapshot, name, { get, configurable: true });
    };
    once('cloud', () => cloudOf(stored.cloud, data.bounds));
    once('visible', () => stored.visible.map(bytesOf));
    return snapshot;
  });
  const truth = data.truth && {
    poses: data.truth.poses,
    cloud: data.truth.cloud && cloudOf(data.truth.cloud, data.truth.bounds),
  };
  const sigmas = data.sigmas && { most: data.sigmas.most, shares: sharesOf(data.sigmas.values) };
  return { ...data, frames, snapshots, truth, sigmas };
}
