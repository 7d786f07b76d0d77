// What the dashboard says, and what `plumb export` writes, in Foxglove Studio itself (studio/, scripts/setup --browser): its topics,
// their numbers and their time, and no problem that it complains of. With a folder as argument, the picture of docs/dashboard.md.
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { createReadStream, existsSync, mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, normalize } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { build, launch, PATIENCE, source } from "./browser.mjs";
import { startLoop } from "./loop.mjs";

const studio = fileURLToPath(new URL("studio/", import.meta.url));
if (!existsSync(`${studio}node_modules/@foxglove/studio-base`)) {
  console.log("skipped: Foxglove Studio is not installed (scripts/setup --browser)");
  process.exit(77);
}
const [pictures] = process.argv.slice(2);
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm", ".png": "image/png", ".ttf": "font/ttf" };
const folder = mkdtempSync(`${tmpdir()}/studio-test.`);
let browser, server, here;

/** Studio's files, and ours: in parts, where a part is asked for. */
function serve(request, response) {
  const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
  const file = path.startsWith("/made/") ? folder + path.slice(5) : studio + (path === "/" ? "index.html" : path);
  if (!existsSync(file)) return response.writeHead(404).end();
  const { size } = statSync(file), head = { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream", "Accept-Ranges": "bytes" };
  const part = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? "");
  const start = part ? Number(part[1]) : 0, end = part?.[2] ? Math.min(Number(part[2]), size - 1) : size - 1;
  response.writeHead(part ? 206 : 200, { ...head, "Content-Length": end - start + 1, ...(part ? { "Content-Range": `bytes ${start}-${end}/${size}` } : {}) });
  if (request.method === "HEAD") return response.end();
  createReadStream(file, { start, end }).pipe(response);
}

before(async () => {
  server = createServer(serve).listen(0, "127.0.0.1");
  await new Promise((resolve) => server.once("listening", resolve));
  here = `http://localhost:${server.address().port}`;
  browser = await launch();
});
after(async () => {
  await browser?.close();
  server.close();
  rmSync(folder, { recursive: true });
});

async function open(kind, url) {
  const page = await (await browser.newContext({ viewport: { width: 1280, height: 800 } })).newPage();
  page.setDefaultTimeout(PATIENCE);
  await page.goto(`${here}/?ds=${kind}&ds.url=${encodeURIComponent(url)}`);
  await page.getByText("plumb.robot_state_t").first().waitFor();
  return page;
}

/** What a panel of raw messages shows of a topic: when it was received [s], and all that is in it. */
async function raw(page, type) {
  const panel = page.locator("text=/ @ [\\d.]+ sec/").filter({ hasText: type }).first();
  await panel.waitFor();
  return page.evaluate((name) => {
    const text = document.body.innerText;
    const begin = text.indexOf(`${name} @ `);
    const [, time] = /@ ([\d.]+) sec/.exec(text.slice(begin));
    return { time, text: text.slice(begin, begin + 400) };
  }, type);
}

async function hasNoProblems(page) {
  await page.getByRole("tab", { name: /Problems/ }).click();
  await page.getByText("No problems found").waitFor();
  await page.getByRole("tab", { name: /Topics/ }).click();
}

test("a record", { timeout: 4 * PATIENCE }, async () => {
  const run = promisify(execFile), log = `${folder}/run.lcmlog`, robot = `${source}/robots/pendulum`;
  await run(`${build}/bin/plumb`, ["launch", robot, "--iterations", "1", "--evaluation-episodes", "1", "--log", log, "--output", `${folder}/recorded`, "--lcm-url", "memq://", "--bus", "loop:"], { maxBuffer: 1e8 });
  await run(`${build}/bin/plumb`, ["export", log, "--mcap", `${folder}/run.mcap`, "--csv", `${folder}/csv`]);
  const page = await open("remote-file", `${here}/made/run.mcap`);
  for (const topic of ["CALIBRATION_STATUS", "PLUMB_FRAME", "PLUMB_SCENE", "POLICY", "ROBOT_STATE"]) await page.getByText(topic, { exact: true }).first().waitFor();
  await hasNoProblems(page);
  const { text } = await raw(page, "plumb.robot_state_t");
  const [, utime] = /utime\s+(\d+)/.exec(text), [, q] = /q\s+\[\] 1 items?\s+0\s+(\S+)/.exec(text);
  const [columns, ...rows] = readFileSync(`${folder}/csv/ROBOT_STATE.csv`, "utf8").trim().split("\n").map((row) => row.split(","));
  const row = rows.find((one) => one[columns.indexOf("utime")] === utime);
  assert.equal(Number(q), Number(row[columns.indexOf("q[0]")]));
  await page.context().close();
});

test("live, by the run's time", { timeout: 4 * PATIENCE }, async () => {
  const robot = pictures ? "hopper" : "pendulum";
  const { loop, ended, address } = await startLoop(robot, ["--iterations", "1", "--evaluation-episodes", "60", "--seed", "3", "--speed", "1", "--origin", here], folder, 20000 + (process.pid % 20000));
  try {
    const page = await open("foxglove-websocket", address.replace("http", "ws"));
    for (let look = 0; look < 3; look++) {
      const { time, text } = await raw(page, "plumb.robot_state_t");
      const [, utime] = /utime\s+(\d+)/.exec(text);
      assert.ok(Math.abs(Number(time) - utime / 1e6) < 0.02, `${utime} received at ${time}`);
      await page.waitForTimeout(1000);
    }
    await raw(page, "plumb.posterior");
    await hasNoProblems(page);
    if (pictures) {
      await page.getByText("Open settings to configure").locator("xpath=..").getByRole("button").first().click();
      await page.waitForTimeout(25_000); // until it hops
      await page.screenshot({ path: `${pictures}/foxglove.png` });
    }
    await page.context().close();
  } finally {
    loop.kill("SIGINT");
    await ended;
  }
});
