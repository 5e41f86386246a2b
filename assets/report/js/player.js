// The scrubber, which goes from the initial guess to the end.

/** How long each snapshot is shown while the replay plays, in milliseconds. */
const INTERVAL = 480;

class Player {
  /** `show(idx, animate)` puts a snapshot on the page. */
  constructor(report, show) {
    Object.assign(this, { report, show, idx: report.snapshots.length - 1, timer: null });
    this.slider = document.getElementById('scrubber');
    this.button = document.getElementById('play');
    this.slider.max = this.idx;
    this.slider.addEventListener('input', () => {
      this.pause();
      this.seek(Number(this.slider.value));
    });
    this.button.addEventListener('click', () => this.toggle());
    document.addEventListener('keydown', (event) => this.onKey(event));
    const still = matchMedia('(prefers-reduced-motion: reduce)');
    this.moves = () => !still.matches;
  }

  get snapshot() {
    return this.report.snapshots[this.idx];
  }

  seek(idx, animate = this.moves()) {
    this.idx = Math.min(Math.max(idx, 0), this.report.snapshots.length - 1);
    this.slider.value = this.idx;
    const { step } = this.snapshot;
    const steps = this.report.hypotheses[this.report.kept];
    const { ordinal, blur, block, poseError } = steps[step];
    const sharpness = blur > 0 ? `blur ${brief(blur)} px` : 'sharp frames';
    const parts = [`Step ${ordinal} of ${steps.at(-1).ordinal}`, sharpness];
    if (block !== 'joint') parts.push(block);
    if (poseError != null) parts.push(`pose error ${poseError.toFixed(2)}°`);
    document.getElementById('now').replaceChildren(...parts.map((part) => element('span', '', part)));
    this.slider.setAttribute('aria-valuetext', parts.join(', '));
    document.documentElement.dataset.snapshot = this.idx;
    this.show(this.idx, animate);
  }

  /** The shown snapshot's place among the steps of its hypothesis. */
  ordinalOf({ step }) {
    return this.report.hypotheses[this.report.kept][step].ordinal;
  }

  /** Goes to the snapshot that is nearest to a place in the chart. */
  seekStep(ordinal) {
    this.pause();
    const distances = this.report.snapshots.map((snapshot) => Math.abs(this.ordinalOf(snapshot) - ordinal));
    this.seek(distances.indexOf(Math.min(...distances)));
  }

  toggle() {
    if (this.timer) return this.pause();
    if (this.idx === this.report.snapshots.length - 1) this.seek(0);
    this.timer = setInterval(() => {
      this.seek(this.idx + 1);
      if (this.idx === this.report.snapshots.length - 1) this.pause();
    }, INTERVAL);
    this.showPlaying(true);
  }

  pause() {
    clearInterval(this.timer);
    this.timer = null;
    this.showPlaying(false);
  }

  showPlaying(playing) {
    this.button.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    this.button.classList.toggle('playing', playing);
  }

  /** Space plays wherever it has no other meaning; Home, End and [ ] work without the focus on the scrubber. */
  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { tagName, type } = event.target;
    const pressesIt = tagName === 'BUTTON' || tagName === 'SUMMARY' || (tagName === 'INPUT' && type !== 'range');
    if (event.key === ' ' && !pressesIt) {
      event.preventDefault();
      this.toggle();
    }
    const steps = { '[': -1, ']': 1 };
    if (steps[event.key]) {
      this.pause();
      this.seek(this.idx + steps[event.key]);
    }
  }
}
