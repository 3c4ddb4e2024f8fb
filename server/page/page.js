// The page: an upload, the events of its job, and the baked scene in three.js. The token stays in this variable.
let token = '';
let job;  // the one that is baked

const at = (id) => document.getElementById(id);
const show = (id, visible) => (at(id).hidden = !visible);

class Problem extends Error {
  constructor(status, problem) {
    super(problem?.detail ?? `the service answers ${status}`);
    this.status = status;
  }
}

async function ask(path, options = {}) {
  const headers = { ...options.headers, ...(token && { Authorization: `Bearer ${token}` }) };
  const answer = await fetch(path, { ...options, headers });
  if (!answer.ok) throw new Problem(answer.status, await answer.json().catch(() => undefined));
  return answer;
}

function complain(error) {
  if (error.status === 401) return askForToken(token !== '');
  at('problem').textContent = error.message;
  show('problem', true);
}

// The token

function askForToken(refused) {
  at('refused').textContent = refused ? 'This token is not known here.' : '';
  show('access', true);
  at('token').focus();
}

at('access').addEventListener('submit', async (event) => {
  event.preventDefault();
  token = at('token').value.trim();
  try {
    await ask('v1/bakes?limit=1');
    at('token').value = '';
    show('access', false);
    show('problem', false);
  } catch (error) {
    complain(error);
  }
});

// The files

let files = [];

function choose(list) {
  files = [...list];
  const scene = files.find((file) => /\.(glb|gltf)$/i.test(file.name));
  at('chosen').textContent = files.length === 0 ? 'Nothing is chosen' : files.map((file) => file.name).join(', ');
  at('bake').disabled = !scene || job !== undefined;
}

at('file').addEventListener('change', () => choose(at('file').files));
for (const name of ['dragover', 'dragleave', 'drop']) {
  addEventListener(name, (event) => {
    event.preventDefault();
    at('drop').classList.toggle('over', name === 'dragover');
    if (name === 'drop' && event.dataTransfer.files.length > 0) choose(event.dataTransfer.files);
  });
}
for (const name of ['error', 'time']) {
  at(name).addEventListener('input', () => (document.querySelector(`[value=${name}]`).checked = true));
}

function parameters() {
  const stop = document.querySelector('[name=stop]:checked').value;
  // With a time, the best that it allows: the error that is asked for is the least that may be.
  return stop === 'error' ? { error: Number(at('error').value) / 100 }
                          : { error: 0.001, time_budget: Number(at('time').value) };
}

function form() {
  const data = new FormData();
  const scene = files.find((file) => /\.(glb|gltf)$/i.test(file.name));
  data.append('parameters', JSON.stringify(parameters()));
  data.append('scene', scene);
  for (const file of files) if (file !== scene) data.append(file.name, file);
  return data;
}

// The job

const integer = (value) => Number(value ?? 0).toLocaleString('en');
const percent = (value) => `${(100 * value).toPrecision(2)} %`;

function tell(state) {
  const { status, progress, phase, statistics } = state;
  at('progress').value = progress;
  const error = statistics.error === undefined || statistics.error >= 1 ? '' : `, error ${percent(statistics.error)}`;
  at('phase').textContent = status === 'running' ? `${phase ?? 'starting'}${error}` : status;
  const iterations = statistics.iterations ?? [];
  show('iterations', iterations.length > 0);
  at('iterations').tBodies[0].replaceChildren(...iterations.map((one) => {
    const row = document.createElement('tr');
    const cells = [one.pass, one.elements, one.links, one.rays].map(integer);
    for (const text of [...cells, Number(one.seconds ?? 0).toFixed(2)]) row.insertCell().textContent = text;
    return row;
  }));
}

// The states of the job as they come, until its end: server-sent events, by hand, since an EventSource carries no
// token. A stream that breaks off is taken up again where it was.
async function* states(path) {
  let last = '';
  while (true) {
    try {
      const answer = await ask(path, { headers: last ? { 'Last-Event-ID': last } : {} });
      if (answer.status === 204) return;
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = '';
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        const events = (text + part.value).split('\n\n');
        text = events.pop();
        for (const event of events) {
          const field = (name) => event.split('\n').find((line) => line.startsWith(`${name}: `))?.slice(name.length + 2);
          if (field('event') !== 'job') continue;
          last = field('id');
          const state = JSON.parse(field('data'));
          yield state;
          if (!['queued', 'running'].includes(state.status)) return;
        }
      }
    } catch (error) {
      if (error instanceof Problem && error.status < 500) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, 1000));
  }
}

async function bake() {
  for (const id of ['problem', 'statistics', 'download', 'iterations']) show(id, false);
  at('bake').disabled = true;
  show('running', true);
  at('progress').removeAttribute('value');
  at('phase').textContent = 'uploading';
  try {
    job = await (await ask('v1/bakes', { method: 'POST', body: form() })).json();
    show('cancel', true);
    for await (const state of states(job.links.events)) tell((job = state));
    if (job.status === 'failed') throw new Error(job.error.detail);
    if (job.status === 'succeeded') await showResult();
  } catch (error) {
    complain(error);
  }
  show('cancel', false);
  show('running', false);
  job = undefined;
  choose(files);
}

at('bake').addEventListener('click', bake);
at('cancel').addEventListener('click', () => ask(job.links.cancel, { method: 'POST' }).catch(complain));

// The result

function describe(statistics) {
  const { error, output, rays, time, memory, stopped_by: stopped, warnings = [] } = statistics;
  const measured = error?.measured;
  const rows = {
    error: measured ? `${percent(measured.relative_rms)} measured (${percent(measured.low)} to ${percent(measured.high)})`
                    : `${percent(error.estimated)} estimated`,
    output: `${integer(output.vertices)} vertices, ${integer(output.triangles)} triangles`,
    rays: integer(rays.count),
    time: `${time.total.toFixed(1)} s, stopped by ${stopped.replace('_', ' ')}`,
    memory: `${integer(Math.round(memory.peak_bytes / 1e6))} MB`,
    ...(warnings.length > 0 && { warnings: warnings.join('; ') }),
  };
  at('statistics').replaceChildren(...Object.entries(rows).flatMap(([name, value]) => {
    const term = document.createElement('dt');
    const definition = document.createElement('dd');
    term.textContent = name;
    definition.textContent = value;
    return [term, definition];
  }));
  show('statistics', true);
}

async function showResult() {
  const { links } = job;
  const glb = await (await ask(links.scene)).arrayBuffer();
  URL.revokeObjectURL(at('download').href);
  at('download').href = URL.createObjectURL(new Blob([glb], { type: 'model/gltf-binary' }));
  show('download', true);
  describe(await (await ask(links.statistics)).json());
  await draw(glb);
}

let stopDrawing = () => {};

async function draw(glb) {
  let THREE, GLTFLoader, OrbitControls;
  try {
    THREE = await import('./three/build/three.module.js');
    ({ GLTFLoader } = await import('./three/examples/jsm/loaders/GLTFLoader.js'));
    ({ OrbitControls } = await import('./three/examples/jsm/controls/OrbitControls.js'));
  } catch {
    at('hint').textContent = 'This service was built without three.js, which would show the scene.';
    return;
  }
  stopDrawing();
  const canvas = at('view');
  const { scene, cameras } = await new GLTFLoader().parseAsync(glb, '');
  show('view', true);
  show('hint', false);
  // What is baked is unlit and needs no light; what is not shows its base colour.
  scene.add(new THREE.AmbientLight(0xffffff, Math.PI));
  scene.updateMatrixWorld(true);
  // Linear radiance to sRGB, and nothing else.
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
  renderer.outputColorSpace = THREE.SRGBColorSpace;
  renderer.toneMapping = THREE.NoToneMapping;

  const ball = new THREE.Box3().setFromObject(scene).getBoundingSphere(new THREE.Sphere());
  const own = cameras.find((one) => one.isPerspectiveCamera);
  const fov = own?.fov ?? 40;
  const away = ball.radius / Math.sin(THREE.MathUtils.degToRad(fov / 2));
  const camera = new THREE.PerspectiveCamera(fov, 1, away * 1e-3, away * 10);
  camera.position.copy(ball.center).add(new THREE.Vector3(0, 0, away));
  const controls = new OrbitControls(camera, canvas);
  controls.target.copy(ball.center);
  if (own) {
    // Its place and its direction; the middle of the scene's depth is what it turns about.
    own.getWorldPosition(camera.position);
    const ahead = own.getWorldDirection(new THREE.Vector3());
    const depth = Math.max(ball.center.clone().sub(camera.position).dot(ahead), 0.1 * ball.radius);
    controls.target.copy(camera.position).addScaledVector(ahead, depth);
  }
  const render = () => {
    const { clientWidth: width, clientHeight: height } = canvas;
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    renderer.render(scene, camera);
  };
  const resized = new ResizeObserver(render);
  resized.observe(canvas);
  controls.addEventListener('change', render);
  controls.update();
  render();
  canvas.dataset.shown = job.id;
  stopDrawing = () => {
    resized.disconnect();
    controls.dispose();
    renderer.dispose();
  };
}

ask('v1/bakes?limit=1').catch(complain);
