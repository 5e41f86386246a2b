// The losses over the steps of every hypothesis.

const CHARTED = {
  objective: { label: 'Objective', log: true },
  photometric: { label: 'Photometric term', log: true },
  silhouette: { label: 'Silhouette term', log: true },
  poseError: { label: 'Pose error (deg)', log: false },
};

/** Significant digits that tell values apart, and no more. */
function brief(value) {
  if (value == null || !isFinite(value)) return '–';
  return Math.abs(value) >= 1000 ? Math.round(value).toLocaleString('en') : String(+value.toPrecision(3));
}

class LossChart {
  constructor(element, report, seek) {
    Object.assign(this, { element, report, seek, quantity: 'objective', step: 0 });
    new ResizeObserver(([entry]) => {
      const width = Math.floor(entry.contentRect.width);
      if (this.plot && width && width !== this.plot.width) this.plot.setSize({ width, height: this.height() });
    }).observe(element);
    element.addEventListener('click', () => {
      const { left } = this.plot.cursor;
      if (left >= 0) this.seek(this.plot.posToVal(left, 'x'));
    });
  }

  height() {
    return window.innerWidth < 600 ? 220 : 260;
  }

  /** Which quantities this report has. */
  quantities() {
    const steps = this.report.hypotheses[this.report.kept];
    return Object.keys(CHARTED).filter((quantity) => steps.some((step) => step[quantity] != null));
  }

  /** Draws a quantity in the colours of the theme. */
  draw(quantity = this.quantity, theme = this.theme) {
    Object.assign(this, { quantity, theme });
    this.plot?.destroy();
    const { hypotheses, kept } = this.report;
    const { label, log } = CHARTED[quantity];
    const value = (step) => (log && !(step[quantity] > 0) ? null : step[quantity]);
    const tables = hypotheses.map((steps) => [steps.map(({ ordinal }) => ordinal), steps.map(value)]);
    const axis = { stroke: theme.muted, grid: { stroke: theme.line, width: 1 }, ticks: { show: false } };
    const values = (_, ticks) => ticks.map((tick) => (tick == null ? '' : brief(tick)));
    const series = hypotheses.map((_, i) => ({
      label: hypotheses.length > 1 ? `${label}, hypothesis ${i + 1}${i === kept ? ' (kept)' : ''}` : label,
      stroke: i === kept ? theme.accent : theme.muted,
      width: i === kept ? 2 : 1.25,
      dash: i === kept ? undefined : [5, 4],
      points: { show: false },
      spanGaps: true,
      value: (_, v) => brief(v),
    }));
    const options = {
      width: Math.max(this.element.clientWidth, 200),
      height: this.height(),
      scales: { x: { time: false }, y: log ? { distr: 3 } : { range: (_, least, most) => [0, most * 1.08 || 1] } },
      axes: [axis, { ...axis, size: 58, values }],
      series: [{ label: 'Step' }, ...series],
      cursor: { drag: { x: false, y: false } },
      hooks: { draw: [(plot) => this.mark(plot)] },
    };
    this.plot = new uPlot(options, uPlot.join(tables), this.element);
    const { canvas } = this.plot.ctx;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `${label} over the steps of the optimisation`);
  }

  /** Where the replay stands. */
  showStep(ordinal) {
    this.step = ordinal;
    this.plot?.redraw(false);
  }

  /** Lines where the frames become sharper, which changes what is minimised, and where the replay stands. */
  mark(plot) {
    const { ctx, bbox } = plot;
    const steps = this.report.hypotheses[this.report.kept];
    const ratio = devicePixelRatio;
    ctx.save();
    ctx.font = `${11 * ratio}px system-ui`;
    Object.assign(ctx, { fillStyle: this.theme.muted, textAlign: 'left', textBaseline: 'alphabetic' });
    let free = bbox.left;
    steps.forEach(({ blur, ordinal }, i) => {
      if (i > 0 && blur === steps[i - 1].blur) return;
      const x = i === 0 ? bbox.left : plot.valToPos(ordinal - 0.5, 'x', true);
      if (i > 0) this.line(ctx, bbox, x, this.theme.muted, 1, [2, 4]);
      const text = blur > 0 ? `blur ${brief(blur)} px` : 'sharp';
      if (x < free) return;
      ctx.fillText(text, x + 5 * ratio, bbox.top + 11 * ratio);
      free = x + ctx.measureText(text).width + 8 * ratio;
    });
    this.line(ctx, bbox, plot.valToPos(this.step, 'x', true), this.theme.strong, 2, []);
    ctx.restore();
  }

  line(ctx, { top, height }, x, color, width, dash) {
    ctx.beginPath();
    ctx.strokeStyle = color;
    ctx.lineWidth = width * devicePixelRatio;
    ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
    ctx.moveTo(x, top);
    ctx.lineTo(x, top + height);
    ctx.stroke();
  }
}
