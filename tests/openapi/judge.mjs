// Judges the service's OpenAPI document by the specification's own schema, and every answer that the tests have seen
// by the document. The document is the one that the service served.
//   node judge.mjs FOLDER [--all]     the folder of the answers; --all: all that are documented must have been seen
import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { Validator } from '@seriousme/openapi-schema-validator';
import Ajv from 'ajv/dist/2020.js';
import addFormats from 'ajv-formats';

// Headers of the transfer itself, which OpenAPI leaves to HTTP.
const kTransport = new Set(['connection', 'content-length', 'content-type', 'transfer-encoding', 'keep-alive']);
const kMethods = ['get', 'head', 'post', 'put', 'patch', 'delete', 'options', 'trace'];

const [folder, ...flags] = process.argv.slice(2);
const answers = readdirSync(folder).flatMap((file) =>
  readFileSync(path.join(folder, file), 'utf8').trimEnd().split('\n').map((line) => JSON.parse(line)));
const served = answers.find(({ target, status, body }) => target === '/openapi.json' && status === 200 && body);
if (!served) throw new Error('no test has asked for /openapi.json');
const document = JSON.parse(served.body);

const problems = new Map();  // each with how often it was seen and an answer where
function complain(what, answer) {
  const known = problems.get(what) ?? { count: 0, answer };
  problems.set(what, { ...known, count: known.count + 1 });
}

const judged = await new Validator().validate(structuredClone(document));
if (!judged.valid) complain(`the document is no OpenAPI 3.1: ${JSON.stringify(judged.errors)}`);
if (document.openapi !== '3.1.0') complain(`the document is of version ${document.openapi}`);

const ajv = new Ajv({ strict: true, strictTypes: false, strictRequired: false, allErrors: true });
addFormats(ajv);
ajv.addVocabulary(['components', 'openapi', 'info', 'servers', 'tags', 'security', 'paths']);
ajv.addSchema(document, 'api');

const resolve = (node) =>
  node?.$ref ? resolve(node.$ref.slice(2).split('/').reduce((at, key) => at[key], document)) : node;

// A schema that stands somewhere in the document, with its references to other places in it.
const validators = new Map();
function errors(schema, value) {
  if (!validators.has(schema)) {
    const text = JSON.stringify(schema).replaceAll('"#/', '"api#/');
    validators.set(schema, ajv.compile(JSON.parse(text)));
  }
  const validate = validators.get(schema);
  return validate(value) ? '' : ajv.errorsText(validate.errors);
}

const routes = Object.entries(document.paths).map(([template, item]) => {
  const parameters = (item.parameters ?? []).map(resolve);
  const pattern = template.replaceAll(/[.*+?^$()|[\]\\]/g, '\\$&').replaceAll(/\{(\w+)\}/g, (_, name) => {
    const { pattern: own = '.*' } = parameters.find((one) => one.name === name).schema;
    return `(?:${own.replace(/^\^|\$$/g, '')})`;
  });
  return { template, item, pattern: new RegExp(`^${pattern}$`) };
});

function headerValue(schema, text) {
  return resolve(schema).type === 'integer' ? Number(text) : text;
}

const seen = new Set();

function judge(answer) {
  const { method, target, status, headers, body } = answer;
  if (status === 100) return;
  const route = routes.find(({ pattern }) => pattern.test((target ?? '').split('?')[0]));
  const name = route ? `${method} ${route.template} ${status}` : `${status} for what is no path`;
  const operation = route?.item[method?.toLowerCase()];
  let response;
  if (operation) {
    response = resolve(operation.responses[status]);
    if (!response) return complain(`${name} is not documented`, answer);
    seen.add(`${operation.operationId} ${status}`);
  } else {
    // Nothing is promised here but a problem.
    const known = Object.values(document.components.responses).map(resolve);
    if (![400, 404, 405, 408, 414, 431, 500, 503].includes(status)) return complain(`${name} is not documented`, answer);
    const code = { 400: 'BadRequest', 404: 'NotFound', 405: 'MethodNotAllowed', 408: 'RequestTimeout',
      414: 'TargetTooLong', 431: 'HeadTooLarge', 500: 'ServerError', 503: 'Unavailable' }[status];
    response = document.components.responses[code] ?? known[0];
  }

  const documented = Object.entries(response.headers ?? {}).map(([key, header]) => [key.toLowerCase(), resolve(header)]);
  for (const [key, header] of documented) {
    if (header.required && !(key in headers)) complain(`${name} has no header ${key}`, answer);
    if (key in headers) {
      const wrong = errors(header.schema, headerValue(header.schema, headers[key]));
      if (wrong) complain(`${name}: header ${key} is ${JSON.stringify(headers[key])}: ${wrong}`, answer);
    }
  }
  const names = new Set(documented.map(([key]) => key));
  for (const key of Object.keys(headers)) {
    if (!names.has(key) && !kTransport.has(key)) complain(`${name}: header ${key} is not documented`, answer);
  }

  const type = headers['content-type']?.split(';')[0];
  // A connection that is one too many is refused before anybody knows that it would ask for the head alone.
  const unread = method === 'HEAD' && status === 503 && body !== '';
  if (!unread && (method === 'HEAD' || status === 204 || status === 304)) {
    if (body !== '') complain(`${name} has a body`, answer);
    return;
  }
  const media = response.content?.[type];
  if (!media) return complain(`${name} is of type ${type}, which is not documented`, answer);
  if (/json$/.test(type) && status !== 206 && !headers['content-encoding']) {
    let value;
    try {
      value = JSON.parse(body);
    } catch {
      return complain(`${name} is no JSON`, answer);
    }
    const wrong = errors(media.schema, value);
    if (wrong) complain(`${name}: ${wrong}`, answer);
    if (type === 'application/problem+json' && value.status !== status) complain(`${name} says another status`, answer);
  }
  if (type === 'text/event-stream') {
    for (const event of body.split('\n\n').filter((text) => text.includes('data: '))) {
      const data = event.split('\n').find((line) => line.startsWith('data: ')).slice(6);
      const wrong = errors(document.components.schemas.Job, JSON.parse(data));
      if (wrong) complain(`${name}: an event: ${wrong}`, answer);
    }
  }
}

answers.forEach(judge);

const all = Object.values(document.paths).flatMap((item) =>
  kMethods.filter((method) => item[method]).map((method) => item[method]));
const documented = all.flatMap(({ operationId, responses }) => Object.keys(responses).map((one) => `${operationId} ${one}`));
if (flags.includes('--all')) for (const one of documented) if (!seen.has(one)) complain(`no test has seen ${one}`);

for (const [what, { count, answer }] of problems) {
  console.log(`${what}${count > 1 ? ` (${count} times)` : ''}`);
  if (answer) console.log(`  ${JSON.stringify({ ...answer, body: answer.body.slice(0, 600) })}`);
}
console.log(`${answers.length} answers, and ${seen.size} of the ${documented.length} that are documented; ` +
  `${problems.size} problems`);
process.exitCode = problems.size === 0 ? 0 : 1;
