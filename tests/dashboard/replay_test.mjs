// A run is looked at, recorded, and replayed to the gateway: what the page shows are LCM's own numbers (expected.mjs). Live;
// replayed in three browsers, beside one that stalls, and in one that comes when all is over; set back, and in a loop.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { copyFileSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { ages, build, clean, launch, look, PATIENCE, source, stall, value } from "./browser.mjs";
import { compare, everything, read } from "./expected.mjs";
import { startGateway, stop } from "./gateway.mjs";

const run = promisify(execFile);
// Of which the model knows too little: there is an alarm, and what was learnt of the rest.
const robot = `${source}/robots/pendulum/worn.toml`;
const url = `udpm://239.255.76.67:${20000 + (process.pid % 20000)}?ttl=0&recv_buf_size=2097152`;
const folder = mkdtempSync(`${tmpdir()}/page-replay.`);
const log = `${folder}/run.lcmlog`;
let browser, gateway, address, live, messages;

async function newGateway() {
  await stop(gateway);
  [gateway, address] = await startGateway(robot, "127.0.0.1:0", url);
}

const record = (of, file) => run(`${build}/bin/plumb`, ["launch", of, "--seed", "1", "--iterations", "2", "--evaluation-episodes", "1", "--log", file, "--output", `${file}.run`, "--lcm-url", url], { maxBuffer: 1e8 });
// Faster than real time, and as slow as browsers on a busy machine can draw.
const replay = (speed, ...part) => [`${build}/bin/plumb`, ["replay", log, "--lcm-url", url, "--speed", String(speed), ...part]];

before(async () => {
  [browser, [gateway, address]] = [await launch(), await startGateway(robot, "127.0.0.1:0", url)];
  live = await look(browser, address);
  await record(robot, log);
  messages = await read(log);
});
after(async () => {
  await browser?.close();
  gateway?.kill();
  rmSync(folder, { recursive: true });
});

test("live, to the end of the run", { timeout: 4 * PATIENCE }, async () => {
  await compare(live, messages);
  clean(live);
  await live.page.context().close();
});

test("replayed to three browsers and one that stalls, and to a late one", { timeout: 8 * PATIENCE }, async () => {
  await newGateway();
  const stalled = await stall(address);
  const browsers = await Promise.all([1, 2, 3].map(() => look(browser, address)));
  const counted = browsers[0].page.locator("#processes [data-process=gateway]");
  await counted.filter({ hasText: "4 browsers" }).waitFor();
  const begun = Date.now();
  await run(...replay(8));
  const ended = Date.now();
  for (const one of browsers) await compare(one, messages);
  const late = await look(browser, address);
  await compare(late, messages, { fast: false });
  // How old each process's last word is, which came while the log was played.
  const asked = Date.now();
  const shown = await late.page.locator("#processes tr[data-process]:not([data-process=gateway]) .age").allInnerTexts();
  assert.equal(shown.length, 5);
  ages(shown).forEach(([least, most], i) => assert.ok(most >= (asked - ended) / 1000 - 1 && least <= (Date.now() - begun) / 1000, `${shown[i]} old`));
  // The gateway has left out what the stalled one did not fetch, for nobody else's loss.
  assert.doesNotMatch(await counted.innerText(), /, 0 messages left out/);
  stalled.destroy();
  [...browsers, late].forEach(clean);
  for (const { page } of [...browsers, late]) await page.context().close();
});

test("played again from an earlier place on, the page shows what it did then, to whoever was there and to who comes late", { timeout: 8 * PATIENCE }, async () => {
  await newGateway();
  const seen = await look(browser, address);
  await run(...replay(8));
  await compare(seen, messages);
  // To before the second update of the posterior, from half of that.
  const second = messages.find(({ channel, message }) => channel === "CALIBRATION_STATUS" && message.iteration === 2).received;
  const to = (second - messages[0].received) / 1e6 - 1, from = to / 2;
  await run(...replay(2, "--from", String(from), "--to", String(to)));
  const then = messages.filter(({ received }) => received <= messages[0].received + to * 1e6);
  assert.ok(then.length < messages.length);
  await seen.page.waitForFunction(() => !document.querySelector("#update .numbers")?.textContent.includes("iteration 2"));
  await compare(seen, then, { counted: false });
  const late = await look(browser, address);
  await compare(late, then, { fast: false, counted: false });
  assert.deepEqual(await everything(seen), await everything(late));
  // In a loop nothing is shown twice.
  const played = then.filter(({ channel, received }) => channel === "DRIVER_STATUS" && received >= messages[0].received + from * 1e6).length;
  const count = seen.page.locator('[data-channel="DRIVER_STATUS"] td').nth(1);
  const before = await value(count);
  const loop = spawn(...replay(8, "--from", String(from), "--to", String(to), "--loop"), { stdio: "ignore" });
  const ended = new Promise((resolve) => loop.once("exit", resolve));
  await seen.page.waitForFunction((many) => Number(document.querySelectorAll('[data-channel="DRIVER_STATUS"] td')[1]?.dataset.value) >= many, before + 2.5 * played, { timeout: 4 * PATIENCE }).finally(() => loop.kill("SIGINT"));
  await ended;
  const last = await look(browser, address);
  await last.page.locator("#events li").first().waitFor();
  await last.page.waitForTimeout(2000); // what the gateway says once a second, and what came last, is drawn
  assert.deepEqual(await everything(seen), await everything(last));
  [seen, late, last].forEach(clean);
  for (const { page } of [seen, late, last]) await page.context().close();
});

test("an update that samples says on how many effective ones it rests", { timeout: 8 * PATIENCE }, async () => {
  const sampling = `${folder}/sampling`, file = `${folder}/sampling.lcmlog`;
  mkdirSync(sampling);
  copyFileSync(`${source}/robots/pendulum/robot.urdf`, `${sampling}/robot.urdf`);
  writeFileSync(`${sampling}/robot.toml`, `extends = "${source}/robots/pendulum/robot.toml"\n[calibration]\nmethod = "mixture"\n`);
  await newGateway();
  const seen = await look(browser, address);
  await record(sampling, file);
  const heard = await read(file);
  assert.ok(heard.some(({ channel, message }) => channel === "CALIBRATION_STATUS" && message.ess > 1));
  await compare(seen, heard);
  clean(seen);
  await seen.page.context().close();
});

test("the gateway is started again, and the page comes back by itself", { timeout: 4 * PATIENCE }, async () => {
  const seen = await look(browser, address, { expected: /ERR_CONNECTION_REFUSED/ });
  await stop(gateway);
  await seen.page.locator("[data-connection=lost]").waitFor();
  [gateway] = await startGateway(robot, new URL(address).host, url);
  await seen.page.locator("[data-connection=open]").waitFor();
  clean(seen);
});
