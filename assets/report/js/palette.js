// Colours of points: of the pictures, of what is seen, or along a scale.

/** Viridis at nine places; it reads alike in grey and for the colour-blind. */
const SCALE = [
  [68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142],
  [31, 158, 137], [53, 183, 121], [110, 206, 88], [253, 231, 37],
];
const UNKNOWN = [128, 132, 140];
const SEEN = [66, 133, 209];
const UNSEEN = [214, 84, 66];
/** The residual at the top of its scale, as a share of the range of colours. */
const MOST_RESIDUAL = 0.25;

/** The scale's colour at a share of its length. */
function scaleColor(share) {
  const x = Math.min(Math.max(share, 0), 1) * (SCALE.length - 1);
  const i = Math.min(Math.floor(x), SCALE.length - 2);
  return SCALE[i].map((a, c) => a + (SCALE[i + 1][c] - a) * (x - i));
}

const cssColor = (rgb) => `rgb(${rgb.map(Math.round).join(' ')})`;

/** Ways to colour the cloud: a colour for a point, and what the legend says. */
const COLORINGS = {
  image: {
    color: (m) => (i) => (m.counts[i] ? m.colors.subarray(3 * i, 3 * i + 3) : UNKNOWN),
    legend: () => [{ color: UNKNOWN, text: 'seen by no frame' }],
  },
  seen: {
    color: (m) => (i) => (m.counts[i] ? SEEN : UNSEEN),
    legend: (report, m) => {
      const share = m.counts.reduce((sum, count) => sum + (count > 0), 0) / m.counts.length;
      const percent = (x) => `${Math.round(100 * x)} %`;
      return [
        { color: SEEN, text: `seen (${percent(share)})` },
        { color: UNSEEN, text: `from the prior alone (${percent(1 - share)})` },
      ];
    },
  },
  residual: {
    color: (m) => (i) => (isNaN(m.residual[i]) ? UNKNOWN : scaleColor(m.residual[i] / MOST_RESIDUAL)),
    legend: () => [
      { scale: true, from: '0', to: `${100 * MOST_RESIDUAL} %`, text: 'difference from reference' },
      { color: UNKNOWN, text: 'not comparable' },
    ],
  },
  uncertainty: {
    color: (m, report) => {
      const shares = sigmaShares(report.sigmas);
      return (i) => scaleColor(shares.values[i]);
    },
    legend: (report) => {
      const { most } = sigmaShares(report.sigmas);
      return [{ scale: true, from: '0', to: most.toPrecision(2), text: 'σ of a point at the end (diagonals)' }];
    },
  },
};

/** Standard deviations up to their 98th percentile, beyond which a few points would take all of the scale. */
function sigmaShares(sigmas) {
  if (!sigmas.values) {
    const sorted = Float32Array.from(sigmas.shares).sort();
    const top = sorted[Math.floor(0.98 * (sorted.length - 1))] || 1;
    sigmas.values = sigmas.shares.map((share) => share / top);
    sigmas.top = top * sigmas.most;
  }
  return { values: sigmas.values, most: sigmas.top };
}

/** Colours of all points as bytes; the fourth is 0 for points without a value, which stand behind others. */
function pointColors(coloring, report, measured) {
  const color = COLORINGS[coloring].color(measured, report);
  const bytes = new Uint8Array(4 * measured.counts.length);
  for (let i = 0; i < measured.counts.length; i++) {
    const found = color(i);
    bytes.set(found, 4 * i);
    bytes[4 * i + 3] = found === UNKNOWN ? 0 : 255;
  }
  return bytes;
}

/** Puts a legend's entries into an element. */
function showLegend(element, entries) {
  element.replaceChildren(
    ...entries.map(({ color, scale, from, to, text }) => {
      const entry = document.createElement('span');
      entry.className = 'legend-entry';
      const swatch = document.createElement('i');
      swatch.className = scale ? 'ramp' : 'swatch';
      swatch.style.background = scale
        ? `linear-gradient(90deg, ${SCALE.map(cssColor).join(', ')})`
        : cssColor(color);
      const label = document.createElement('span');
      label.textContent = text;
      entry.append(...(scale ? [from, swatch, to, label] : [swatch, label]));
      return entry;
    }),
  );
}
