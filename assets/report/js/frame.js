// One frame, magnified, with what a snapshot projects into it.

/** Share of the object's extent that is shown around it. */
const FRAME_MARGIN = 0.22;

/** The part of the frames that shows the object in all of them: left, top, width, height in shares. */
function objectWindow(frames) {
  let [left, top, right, bottom] = [1, 1, 0, 0];
  for (const { outline } of frames) {
    for (let i = 0; i < outline.length; i += 2) {
      [left, right] = [Math.min(left, outline[i]), Math.max(right, outline[i])];
      [top, bottom] = [Math.min(top, outline[i + 1]), Math.max(bottom, outline[i + 1])];
    }
  }
  if (left >= right) return [0, 0, 1, 1];
  const margin = FRAME_MARGIN * Math.max(right - left, bottom - top);
  [left, top] = [Math.max(left - margin, 0), Math.max(top - margin, 0)];
  [right, bottom] = [Math.min(right + margin, 1), Math.min(bottom + margin, 1)];
  return [left, top, right - left, bottom - top];
}

class FrameView {
  constructor(canvas, report) {
    this.canvas = canvas;
    this.report = report;
    this.window = objectWindow(report.frames);
    const [width, height] = report.size;
    canvas.style.aspectRatio = `${this.window[2] * width} / ${this.window[3] * height}`;
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** What to draw: a frame, a snapshot's measurements, `points`, `residual` or `none` over it, outline or not. */
  show(state) {
    this.state = state;
    this.draw();
  }

  draw() {
    if (!this.state || !this.canvas.clientWidth) return;
    const { canvas, window: [left, top, width, height] } = this;
    const ratio = Math.min(devicePixelRatio, 2);
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round((canvas.width * height * this.report.size[1]) / (width * this.report.size[0]));
    const context = canvas.getContext('2d');
    const { image, outline } = this.report.frames[this.state.frame];
    const [w, h] = [image.naturalWidth, image.naturalHeight];
    context.imageSmoothingEnabled = false;
    context.drawImage(image, left * w, top * h, width * w, height * h, 0, 0, canvas.width, canvas.height);

    const place = (u, v) => [((u - left) / width) * canvas.width, ((v - top) / height) * canvas.height];
    const pixel = canvas.width / (width * this.report.size[0]);
    if (this.state.layer === 'points') this.drawPoints(context, place, ratio);
    if (this.state.layer === 'residual') this.drawResidual(context, place, pixel);
    if (this.state.outline) this.drawOutline(context, place, outline, ratio);
  }

  drawPoints(context, place, ratio) {
    const { frame, snapshot, measured } = this.state;
    context.fillStyle = 'rgb(70 150 255 / 0.75)';
    const side = 1.2 * ratio;
    this.eachPoint(measured.pixels[frame], place, (i, x, y) => {
      if (isSeen(snapshot.visible[frame], i)) context.fillRect(x - side / 2, y - side / 2, side, side);
    });
  }

  drawResidual(context, place, pixel) {
    const { frame, measured } = this.state;
    context.fillStyle = 'rgb(16 17 20 / 0.82)';
    context.fillRect(0, 0, context.canvas.width, context.canvas.height);
    const side = Math.max(1.1 * pixel, 2);
    this.eachPoint(measured.pixels[frame], place, (i, x, y) => {
      const residual = measured.residuals[frame][i];
      if (isNaN(residual)) return;
      context.fillStyle = cssColor(scaleColor(residual / MOST_RESIDUAL));
      context.fillRect(x - side / 2, y - side / 2, side, side);
    });
  }

  eachPoint(pixels, place, draw) {
    const [width, height] = this.report.size;
    for (let i = 0; i < pixels.length / 2; i++) {
      const [x, y] = place(pixels[2 * i] / width, pixels[2 * i + 1] / height);
      draw(i, x, y);
    }
  }

  /** Samples of the outline lie so near one another that dots make a line. */
  drawOutline(context, place, outline, ratio) {
    const side = 2 * ratio;
    for (const [color, width] of [['rgb(0 0 0 / 0.5)', side + 1.5 * ratio], ['rgb(255 210 60)', side]]) {
      context.fillStyle = color;
      for (let i = 0; i < outline.length; i += 2) {
        const [x, y] = place(outline[i], outline[i + 1]);
        context.fillRect(x - width / 2, y - width / 2, width, width);
      }
    }
  }
}

/** The frames as a row of radio buttons: arrow keys go through them. */
function fillStrip(strip, frames, select) {
  const buttons = frames.map((frame, l) => {
    const label = document.createElement('label');
    const input = Object.assign(document.createElement('input'), { type: 'radio', name: 'frame', value: l });
    input.checked = l === 0;
    const what = l === 0 ? `Frame 0, the reference` : `Frame ${l}`;
    const picture = Object.assign(document.createElement('img'), { src: frame.image.src, alt: what });
    picture.title = `${what}: ${frame.name}`;
    const number = Object.assign(document.createElement('span'), { textContent: l });
    number.setAttribute('aria-hidden', 'true');
    input.addEventListener('change', () => select(l));
    label.append(input, picture, number);
    return label;
  });
  strip.append(...buttons);
}
