// What somebody does with the page, and what they must see.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import readline from 'node:readline';
import { Browser } from './browser.mjs';
import { decode } from './png.mjs';

const [bin, scratch] = process.argv.slice(2);
const kScene = path.join(import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname),
  '../../scenes/cornell-box.glb');
const kToken = 'a-token-of-the-test';

async function serve(name, ...flags) {
  const service = spawn(path.join(bin, 'radbaked'),
    ['--listen', '127.0.0.1:0', '--data', path.join(scratch, name), ...flags], { stdio: ['ignore', 'pipe', 'ignore'] });
  for await (const line of readline.createInterface({ input: service.stdout })) {
    return { url: line.replace('listening on ', ''), stop: () => service.kill('SIGTERM') };
  }
  throw new Error('radbaked does not start');
}

const click = (browser, id) => browser.value(`document.getElementById('${id}').click()`);
const text = (browser, id) => browser.value(`document.getElementById('${id}').innerText`);
const shown = (browser, id) => browser.value(`!document.getElementById('${id}').hidden`);

async function bakeTheCornellBox(browser) {
  await browser.choose('#file', [kScene]);
  await browser.value(`document.getElementById('error').value = 8`);
  await click(browser, 'bake');
  await browser.until(`document.getElementById('view').dataset.shown || !document.getElementById('problem').hidden`);
  assert.equal(await text(browser, 'problem'), '');
  await browser.until(`document.getElementById('running').hidden`);
}

function onlyFrom(url, browser) {
  const others = browser.requests.filter((one) => !one.startsWith(url) && !one.startsWith('blob:') && !one.startsWith('data:'));
  assert.deepEqual(others, [], 'the page asks nobody else');
}

async function thePageBakesAndShows(browser) {
  const service = await serve('open');
  try {
    await browser.visit(`${service.url}/`);
    assert.equal(await browser.value(`document.getElementById('bake').disabled`), true);
    await bakeTheCornellBox(browser);
    const statistics = await text(browser, 'statistics');
    assert.match(statistics, /measured \(/);
    assert.match(statistics, /stopped by error/);
    assert.equal(await shown(browser, 'download'), true);
    assert.equal(await shown(browser, 'iterations'), true);
    writeFileSync(path.join(scratch, 'page.png'), await browser.picture());
    // The box as its camera sees it: a red wall on the left, a green one on the right, light above.
    const { width, height, at } = decode(await browser.picture('#view'));
    const middle = Math.floor(height / 2);
    const row = Array.from({ length: width }, (_, x) => at(x, middle));
    const red = row.findIndex(([r, g, b]) => r > 2 * g && r > 2 * b && r > 60);
    const green = row.findLastIndex(([r, g, b]) => g > 1.4 * r && g > 1.4 * b && g > 60);
    assert.ok(red >= 0 && green > red + height / 4, `the walls stand at ${red} and ${green} of ${width}`);
    const colours = new Set(row.map(String)).size;
    assert.ok(colours > 30, `light that falls off has more than ${colours} shades`);

    // What cannot be baked is said, and the next can be.
    const junk = path.join(scratch, 'junk.glb');
    writeFileSync(junk, 'no glTF at all');
    await browser.choose('#file', [junk]);
    await click(browser, 'bake');
    await browser.until(`!document.getElementById('problem').hidden`);
    assert.match(await text(browser, 'problem'), /not glTF/);
    browser.complaints = browser.complaints.filter((one) => !/status of 422/.test(one));  // which the log of a browser repeats
    onlyFrom(service.url, browser);
    assert.deepEqual(browser.complaints, []);
  } finally {
    service.stop();
  }
}

async function thePageAsksForAToken(browser) {
  const tokens = path.join(scratch, 'tokens');
  writeFileSync(tokens, `me ${createHash('sha256').update(kToken).digest('hex')}\n`);
  const service = await serve('closed', '--tokens', tokens);
  const enter = async (token) => {
    await browser.value(`document.getElementById('token').value = '${token}'`);
    await browser.value(`document.getElementById('access').requestSubmit()`);
  };
  try {
    await browser.visit(`${service.url}/`);
    await browser.until(`!document.getElementById('access').hidden`);
    await enter('another');
    await browser.until(`document.getElementById('refused').innerText !== ''`);
    await enter(kToken);
    await browser.until(`document.getElementById('access').hidden`);
    await bakeTheCornellBox(browser);
    const kept = await browser.value(`document.cookie + location.href + JSON.stringify({ ...localStorage }) +
      JSON.stringify({ ...sessionStorage }) + document.documentElement.outerHTML + document.getElementById('token').value`);
    assert.ok(!kept.includes(kToken), 'the token is kept nowhere but in memory');
    assert.ok(browser.requests.every((one) => !one.includes(kToken)), 'and stands in no URL');
  } finally {
    service.stop();
  }
}

// The same scene as a .gltf with its buffer in a file of its own.
function unpack(glb, folder) {
  const length = glb.readUInt32LE(12);
  const gltf = JSON.parse(glb.subarray(20, 20 + length));
  gltf.buffers[0].uri = 'box.bin';
  const files = [path.join(folder, 'box.gltf'), path.join(folder, 'box.bin')];
  writeFileSync(files[0], JSON.stringify(gltf));
  writeFileSync(files[1], glb.subarray(28 + length));
  return files;
}

async function thePageTakesSeveralFilesAndATimeAndCancels(browser) {
  const service = await serve('several');
  try {
    await browser.visit(`${service.url}/`);
    await browser.choose('#file', unpack(readFileSync(kScene), scratch));
    await browser.value(`document.querySelector('[value=time]').click()`);
    await browser.value(`document.getElementById('time').value = 100`);
    await click(browser, 'bake');
    await browser.until(`!document.getElementById('cancel').hidden && !document.getElementById('iterations').hidden`);
    await click(browser, 'cancel');
    await browser.until(`document.getElementById('running').hidden`);
    assert.equal(await text(browser, 'problem'), '');
    assert.equal(await shown(browser, 'download'), false);

    await browser.value(`document.getElementById('time').value = 1`);
    await click(browser, 'bake');
    await browser.until(`document.getElementById('view').dataset.shown || !document.getElementById('problem').hidden`);
    assert.equal(await text(browser, 'problem'), '');
    assert.match(await text(browser, 'statistics'), /stopped by time budget/);
    assert.deepEqual(browser.complaints, []);
  } finally {
    service.stop();
  }
}

for (const test of [thePageBakesAndShows, thePageAsksForAToken, thePageTakesSeveralFilesAndATimeAndCancels]) {
  const browser = await Browser.open();
  try {
    await test(browser);
    console.log(`${test.name}: passed`);
  } catch (error) {
    writeFileSync(path.join(scratch, `${test.name}.png`), await browser.picture().catch(() => ''));
    console.error(`${test.name}: ${error.stack}\n${browser.complaints.join('\n')}`);
    process.exitCode = 1;
  } finally {
    await browser.close();
  }
}
process.exit();
