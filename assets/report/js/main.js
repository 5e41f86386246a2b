// Puts the page together.

const THEME_COLORS = ['background', 'accent', 'strong', 'truth', 'muted', 'line'];

/** The theme's colours as they come out, light or dark. */
function themeColors() {
  const probe = element('i');
  document.body.append(probe);
  const read = (name) => {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  };
  const colors = Object.fromEntries(THEME_COLORS.map((name) => [name, read(name)]));
  probe.remove();
  return colors;
}

/** The value of a group of radio buttons, now and whenever it changes. */
function onChoice(name, use) {
  const inputs = document.querySelectorAll(`input[name="${name}"]`);
  inputs.forEach((input) => input.addEventListener('change', () => use(input.value)));
}

function onSwitch(id, use) {
  const input = document.getElementById(id);
  input.addEventListener('change', () => use(input.checked));
  return input;
}

/** Removes what a report has nothing to show for. */
function hideAbsent(report, chart) {
  const hide = (input) => (input.closest('label').hidden = true);
  if (!report.sigmas) hide(document.querySelector('input[value="uncertainty"]'));
  if (!report.truth?.poses) hide(document.getElementById('true-cameras'));
  if (!report.truth?.cloud) hide(document.getElementById('true-cloud'));
  const known = chart.quantities();
  document.querySelectorAll('input[name="quantity"]').forEach((input) => {
    if (!known.includes(input.value)) hide(input);
  });
}

/** The 3D view, or nothing where the browser cannot draw one. */
function makeScene(report) {
  try {
    return new Scene3D(document.getElementById('view'), report);
  } catch (error) {
    document.getElementById('no-webgl').hidden = false;
    return null;
  }
}

function connectScene(scene, player) {
  document.querySelectorAll('button[data-viewpoint]').forEach((button) => {
    button.addEventListener('click', () => lookFrom(scene, button.dataset.viewpoint, player.snapshot));
  });
  const visible = (object) => (shown) => {
    object.visible = shown;
    scene.requestRender();
  };
  onSwitch('cameras', (shown) => [scene.cameras, scene.selected].forEach((lines) => visible(lines)(shown)));
  if (scene.trueCameras) onSwitch('true-cameras', visible(scene.trueCameras));
  if (scene.trueCloud) onSwitch('true-cloud', visible(scene.trueCloud));
  turnByKeys(scene);
}

function connectTheme(apply) {
  const root = document.documentElement;
  const prefersDark = matchMedia('(prefers-color-scheme: dark)');
  const isDark = () => (root.style.colorScheme || (prefersDark.matches ? 'dark' : 'light')) === 'dark';
  const button = document.getElementById('theme');
  const label = () => button.setAttribute('aria-label', isDark() ? 'Use light colours' : 'Use dark colours');
  button.addEventListener('click', () => {
    root.style.colorScheme = isDark() ? 'light' : 'dark';
    label();
    apply();
  });
  prefersDark.addEventListener('change', () => (label(), apply()));
  label();
}

async function main() {
  const report = await decodeReport(JSON.parse(document.getElementById('data').textContent));
  document.title = `${report.name}: reconstruction`;
  document.getElementById('name').textContent = report.name;
  document.getElementById('summary').textContent = summary(report);
  fillHeadlines(document.getElementById('headlines'), report);
  fillTables(report);

  const measurements = new Measurements(report);
  const scene = makeScene(report);
  const frameView = new FrameView(document.getElementById('frame'), report);
  const state = { coloring: 'image', frame: 0, layer: 'points', outline: true };
  const drawFrame = () => {
    const { snapshot } = player;
    frameView.show({ ...state, snapshot, measured: measurements.of(snapshot) });
    const legend = state.layer === 'residual' ? COLORINGS.residual.legend().slice(0, 1) : [];
    showLegend(document.getElementById('frame-legend'), legend);
  };
  const colorCloud = () => {
    const measured = measurements.of(player.snapshot);
    scene?.colorPoints(pointColors(state.coloring, report, measured));
    showLegend(document.getElementById('legend'), COLORINGS[state.coloring].legend(report, measured));
  };
  const player = new Player(report, (_, animate) => {
    scene?.show(player.snapshot, animate);
    colorCloud();
    drawFrame();
    chart.showStep(player.ordinalOf(player.snapshot));
  });
  const chart = new LossChart(document.getElementById('chart'), report, (step) => player.seekStep(step));

  onChoice('coloring', (coloring) => (Object.assign(state, { coloring }), colorCloud()));
  onChoice('layer', (layer) => (Object.assign(state, { layer }), drawFrame()));
  onSwitch('outline', (outline) => (Object.assign(state, { outline }), drawFrame()));
  onChoice('quantity', (quantity) => chart.draw(quantity));
  fillStrip(document.getElementById('strip'), report.frames, (frame) => {
    Object.assign(state, { frame });
    scene?.selectFrame(frame);
    if (scene?.viewpoint === 'frame') lookFrom(scene, 'frame', player.snapshot);
    drawFrame();
  });
  const applyTheme = () => {
    const colors = themeColors();
    scene?.setTheme(colors);
    chart.draw(undefined, colors);
  };
  connectTheme(applyTheme);
  applyTheme();
  hideAbsent(report, chart);
  player.seek(report.snapshots.length - 1, false);
  if (scene) {
    connectScene(scene, player);
    lookFrom(scene, 'object', player.snapshot);
  }
  requestAnimationFrame(() => {
    document.documentElement.dataset.readyAfter = Math.round(performance.now());
  });
}

main();
