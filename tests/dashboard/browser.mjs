// A headless Chromium that looks at the page, and what it must never do: complain, or ask anybody but the gateway. Without
// Chromium, the page's packages or the built page a test ends as skipped, with the reason.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { createRequire } from "node:module";
import { connect } from "node:net";
import { resolve } from "node:path";
import { fileURLToPath } from "node:url";

const web = new URL("../../dashboard/web/", import.meta.url);
export const source = process.env.PLUMBLINE_SOURCE ?? fileURLToPath(new URL("../..", import.meta.url));
export const build = resolve(source, process.env.PLUMBLINE_BUILD ?? "build");
export const pageFolder = `${build}/dashboard/page`;
const CHROMIUM = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);

function skipUnless(there, reason) {
  if (there) return;
  console.log(`skipped: ${reason}`);
  process.exit(77);
}
skipUnless(CHROMIUM, "Chromium is not installed (scripts/setup --browser)");
skipUnless(existsSync(new URL("node_modules/playwright-core", web)), "the page's packages are not installed (scripts/setup --page)");
skipUnless(existsSync(`${pageFolder}/page.js`), `there is no built page in ${pageFolder} (scripts/build dashboard_page)`);

const { chromium } = createRequire(new URL("package.json", web))("playwright-core");
export const PATIENCE = 120_000; // [ms] for a busy machine: nothing here is about how fast it is

export const launch = () => chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });

/** Opens the page. `complaints` has what the console said, `strangers` who else was asked. A reason to be silent is `expected`. */
export async function look(browser, url, { expected = /^$/, ...context } = {}) {
  const page = await (await browser.newContext({ viewport: { width: 1440, height: 1000 }, ...context })).newPage();
  page.setDefaultTimeout(PATIENCE);
  const complaints = [], strangers = [];
  page.on("console", (said) => ["error", "warning"].includes(said.type()) && !expected.test(said.text()) && complaints.push(said.text()));
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("request", (request) => new URL(request.url()).host !== new URL(url).host && strangers.push(request.url()));
  page.on("websocket", (socket) => new URL(socket.url()).host !== new URL(url).host && strangers.push(socket.url()));
  await page.goto(url);
  await page.locator("[data-connection=open]").waitFor();
  return { page, complaints, strangers };
}

/** What no page may have done. */
export function clean({ complaints, strangers }) {
  assert.deepEqual(complaints, []);
  assert.deepEqual(strangers, []);
}

/** The numbers of a table behind a panel, to all digits: rows of cells, numbers where they are numbers. */
export async function numbers(page, panel, table = 0) {
  const button = page.locator(`#${panel} > header button[aria-expanded]`);
  if ((await button.getAttribute("aria-expanded")) === "false") await button.click();
  return page.locator(`#${panel} > .numbers table`).nth(table).evaluate((found) =>
    [...found.tBodies[0].rows].map((row) => [...row.cells].map((cell) => ("value" in cell.dataset ? (cell.dataset.value === "null" ? null : Number(cell.dataset.value)) : cell.textContent))));
}

/** The number that an element shows, to all digits. */
export const value = async (found) => {
  const text = await found.getAttribute("data-value");
  return text === "null" ? null : Number(text);
};

/** The ages that a page shows [s], the least and the most that each may be: they are rounded to two digits, to minutes, to hours. */
export function ages(texts) {
  return texts.map((text) => {
    if (text === "now") return [0, 0.1];
    const [, figure, unit] = /^([\d.]+) (ms|s|min|h)$/.exec(text) ?? [];
    assert.ok(unit, `${text} is no age`);
    const length = { ms: 1e-3, s: 1, min: 60, h: 3600 }[unit], half = unit === "min" || unit === "h" ? 0.5 : 0.05 * figure;
    return [(figure - half) * length, (Number(figure) + half) * length];
  });
}

/** Of a browser that asks for everything, more than there is, and reads nothing: its socket, when it has asked. */
export function stall(address) {
  const { hostname, port } = new URL(address);
  const socket = connect(Number(port), hostname);
  socket.write(`GET / HTTP/1.1\r\nHost: ${hostname}:${port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n`);
  return new Promise((resolve) => socket.once("data", () => {
    socket.pause();
    const text = Buffer.from(JSON.stringify({ op: "subscribe", subscriptions: Array.from({ length: 40 }, (_, id) => ({ id, channelId: 1 + id })) }));
    const head = Buffer.from([0x81, 0xfe, text.length >> 8, text.length & 255, 0, 0, 0, 0]); // the mask is zero
    socket.write(Buffer.concat([head, text]));
    resolve(socket);
  }));
}
