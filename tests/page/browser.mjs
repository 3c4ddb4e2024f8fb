// A headless Chromium, spoken to over pipes (the DevTools protocol).
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';

export class Browser {
  #pending = new Map();
  #number = 0;
  #session;
  #text = '';
  requests = [];    // URLs, of all that the page has asked for
  complaints = [];  // what the browser has found fault with: errors, broken policies

  static async open() {
    const browser = new Browser();
    browser.profile = mkdtempSync(path.join(os.tmpdir(), 'radbake-page-'));
    const flags = ['--headless=new', '--remote-debugging-pipe', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
      '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync',
      '--disable-dev-shm-usage', `--user-data-dir=${browser.profile}`, '--window-size=1200,800'];
    if (process.getuid() === 0) flags.push('--no-sandbox');
    browser.process = spawn('chromium', [...flags, 'about:blank'],
      { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'], detached: true });
    browser.process.stdio[4].on('data', (data) => browser.#take(data));
    browser.ended = new Promise((resolve) => browser.process.on('exit', resolve));
    const { targetInfos } = await browser.send('Target.getTargets');
    const { targetId } = targetInfos.find(({ type }) => type === 'page');
    ({ sessionId: browser.#session } = await browser.send('Target.attachToTarget', { targetId, flatten: true }));
    for (const domain of ['Page', 'Runtime', 'Network', 'Log', 'DOM']) await browser.send(`${domain}.enable`);
    return browser;
  }

  send(method, params = {}) {
    const id = ++this.#number;
    this.process.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId: this.#session })}\0`);
    return new Promise((resolve, reject) => this.#pending.set(id, { resolve, reject }));
  }

  #take(data) {
    const messages = (this.#text + data).split('\0');
    this.#text = messages.pop();
    for (const { id, result, error, method, params } of messages.map((text) => JSON.parse(text))) {
      if (id !== undefined) {
        const { resolve, reject } = this.#pending.get(id);
        this.#pending.delete(id);
        if (error) reject(new Error(error.message));
        else resolve(result);
      } else if (method === 'Network.requestWillBeSent') {
        this.requests.push(params.request.url);
      } else if (method === 'Log.entryAdded' && params.entry.level === 'error') {
        this.complaints.push(`${params.entry.text} ${params.entry.url ?? ''}`);
      } else if (method === 'Runtime.exceptionThrown') {
        this.complaints.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
      }
    }
  }

  async visit(url) {
    await this.send('Page.navigate', { url });
    await this.until(`document.readyState === 'complete'`);
  }

  // The value of an expression in the page.
  async value(expression) {
    const { result, exceptionDetails } = await this.send('Runtime.evaluate',
      { expression, awaitPromise: true, returnByValue: true, userGesture: true });
    if (exceptionDetails) throw new Error(`${expression}: ${exceptionDetails.exception?.description}`);
    return result.value;
  }

  async until(expression) {
    const end = Date.now() + 120_000;
    while (!(await this.value(expression))) {
      if (Date.now() > end) throw new Error(`never: ${expression}; the page shows:\n${await this.value('document.body.innerText')}`);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  async choose(selector, files) {
    const { root } = await this.send('DOM.getDocument');
    const { nodeId } = await this.send('DOM.querySelector', { nodeId: root.nodeId, selector });
    await this.send('DOM.setFileInputFiles', { nodeId, files });
  }

  // A PNG; of all, or of an element.
  async picture(selector) {
    const rectangle = selector && await this.value(`(({ x, y, width, height }) => ({ x, y, width, height, scale: 1 }))(
      document.querySelector('${selector}').getBoundingClientRect())`);
    const { data } = await this.send('Page.captureScreenshot', { format: 'png', ...(rectangle && { clip: rectangle }) });
    return Buffer.from(data, 'base64');
  }

  async close() {
    try {
      process.kill(-this.process.pid, 'SIGKILL');
    } catch {
      // it has ended by itself
    }
    await this.ended;
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 10, retryDelay: 100 });
  }
}
