// A run is looked at, recorded, and replayed to the gateway: what the page shows are LCM's own numbers, decoded from the log by
// lcm-gen's Python types. Live; then replayed in three browsers, beside one that stalls, and in one that comes when all is over.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { build, clean, launch, look, numbers, PATIENCE, value } from "./browser.mjs";

const run = promisify(execFile);
const source = process.env.PLUMBLINE_SOURCE ?? new URL("../..", import.meta.url).pathname;
const robot = `${source}/robots/pendulum`;
const here = (name) => new URL(name, import.meta.url).pathname;
const url = `udpm://239.255.76.67:${20000 + (process.pid % 20000)}?ttl=0&recv_buf_size=2097152`;
const folder = mkdtempSync(`${tmpdir()}/page-replay.`);
const log = `${folder}/run.lcmlog`;
let browser, gateway, address, live;
const robotSteps = 200; // of an episode: robots/pendulum/robot.toml
const said = {}; // messages of the log, by channel
const last = (channel) => said[channel].at(-1);

/** The gateway, and where it listens. */
async function startGateway(at) {
  const process = spawn(`${build}/bin/plumb-dashboard`, [robot, "--address", at, "--lcm-url", url], { stdio: ["ignore", "pipe", "inherit"] });
  for await (const line of createInterface({ input: process.stdout })) {
    const found = /http:\/\/\S+/.exec(line);
    if (found) return [process, found[0]];
  }
  throw new Error("the gateway has not come up");
}

async function stopGateway() {
  const gone = new Promise((resolve) => gateway.once("exit", resolve));
  gateway.kill();
  await gone;
}

/** A browser that asks for everything, ten times over, and reads nothing. */
function stall({ hostname, port }) {
  const socket = connect(Number(port), hostname);
  socket.write(`GET / HTTP/1.1\r\nHost: ${hostname}:${port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n`);
  return new Promise((resolve) => socket.once("data", () => {
    socket.pause();
    const text = Buffer.from(JSON.stringify({ op: "subscribe", subscriptions: Array.from({ length: 400 }, (_, id) => ({ id, channelId: 1 + (id % 40) })) }));
    const head = Buffer.from([0x81, 0xfe, text.length >> 8, text.length & 255, 0, 0, 0, 0]); // the mask is zero
    socket.write(Buffer.concat([head, text]));
    resolve(socket);
  }));
}

before(async () => {
  [browser, [gateway, address]] = [await launch(), await startGateway("127.0.0.1:0")];
  live = await look(browser, address);
  await run(`${build}/bin/plumb`, ["launch", robot, "--seed", "1", "--iterations", "1", "--log", log, "--output", `${folder}/run`, "--lcm-url", url], { maxBuffer: 1e8 });
  const { stdout } = await run("/usr/bin/python3", [here("log_json.py"), `${build}/lcmtypes/python`, log], { maxBuffer: 1e9 });
  for (const line of stdout.trim().split("\n")) {
    const { channel, message } = JSON.parse(line);
    (said[channel] ??= []).push(message);
  }
});
after(async () => {
  await browser?.close();
  gateway?.kill();
  rmSync(folder, { recursive: true });
});

const near = (shown, meant, what) => assert.ok(shown === meant || Math.abs(shown - meant) <= 1e-9 * Math.abs(meant), `${what}: ${shown} is shown, ${meant} was said`);

/** Every panel's numbers are those that were said last, or of each iteration. */
async function compare({ page }, fast) {
  const state = last("DRIVER_STATUS");
  await page.waitForFunction((cycles) => document.querySelector("[data-counter=cycles]")?.dataset.value === String(cycles), state.cycles);
  for (const counter of await page.locator("[data-counter]").all()) {
    const name = await counter.getAttribute("data-counter");
    near(await value(counter), state[name], name);
  }
  const bins = await numbers(page, "cycle");
  state.lateness.forEach((count, i) => near(bins[i][1], count, `lateness, bin ${i}`));
  state.phase_duration.forEach((phase, p) => phase.forEach((count, i) => near(bins[i][2 + p], count, `${state.phase_name[p]}, bin ${i}`)));

  const byIteration = new Map(said.CALIBRATION_STATUS.map((one) => [one.iteration, one]));
  const learnt = [...byIteration.values()].filter((one) => one.iteration > 0);
  assert.deepEqual(await numbers(page, "update"), learnt.map((one) => [one.iteration, one.kl, one.ess, one.temperature, one.transitions, one.rollouts, one.seconds]));
  assert.deepEqual(await numbers(page, "fan"), learnt.flatMap((one) => one.horizon.map((n, i) => [one.iteration, n, one.error_prior[i], one.error_before[i], one.error_after[i]])));
  assert.deepEqual(await numbers(page, "gap"), learnt.map((one) => [one.iteration, one.discrepancy, one.prior_discrepancy]));
  for (const [iteration, name, mean, sd] of await numbers(page, "posterior")) {
    const one = byIteration.get(iteration), at = said.PARAMETER_DISTRIBUTION[0].name.indexOf(name);
    near(mean, one.mean[at], `${name}, mean of iteration ${iteration}`);
    near(sd, one.sd[at], `${name}, sd of iteration ${iteration}`);
  }

  const training = last("TRAINING_STATUS");
  assert.deepEqual((await numbers(page, "training")).at(-1), [training.iteration, training.update, training.steps, training.mean_return, training.kl, training.surrogate_gain, training.explained_variance, training.entropy]);
  const controller = last("CONTROLLER_STATUS");
  const lastOf = new Map(said.CONTROLLER_STATUS.filter((one) => one.policy_iteration >= 0).map((one) => [one.policy_iteration, one]));
  assert.deepEqual(await numbers(page, "returns", 1), [...lastOf].flatMap(([policy, one]) => one.returns.map((sum, i) => [policy, i + 1, one.steps[i], sum, one.fell[i] ? sum : sum + one.late_rate[i] * (robotSteps - one.steps[i])])));
  const [, , , simulated, tenth, worst] = (await numbers(page, "returns")).find(([policy]) => policy === training.iteration);
  assert.deepEqual([simulated, tenth, worst], [training.evaluation_return, training.evaluation_tenth, training.evaluation_worst]);
  near(await value(page.locator("[data-episode] [data-value]").last()), controller.episode_return, "return so far");

  for (const channel of Object.keys(said)) {
    const row = page.locator(`[data-channel="${channel}"] td`);
    near(await value(row.nth(1)), said[channel].length, `messages of ${channel}`);
    near(await value(row.nth(5)), 0, `undecodable of ${channel}`);
  }
  if (!fast) return;
  const robotState = last("ROBOT_STATE");
  near(await value(page.locator("table.state td").first()), robotState.q[0], "position");
  near(await value(page.locator("table.state td").nth(2)), robotState.v[0], "velocity");
}

test("live, to the end of the run", { timeout: 4 * PATIENCE }, async () => {
  await compare(live, true);
  clean(live);
  await live.page.context().close();
});

test("replayed to three browsers and one that stalls, and to a late one", { timeout: 8 * PATIENCE }, async () => {
  await stopGateway();
  [gateway, address] = await startGateway("127.0.0.1:0");
  const stalled = await stall(new URL(address));
  const browsers = await Promise.all([1, 2, 3].map(() => look(browser, address)));
  const counted = browsers[0].page.locator("#processes [data-process=gateway]");
  await counted.filter({ hasText: "4 browsers" }).waitFor();
  await run("lcm-logplayer", ["-s", "8", `--lcm-url=${url}`, log]);
  for (const one of browsers) await compare(one, true);
  const late = await look(browser, address);
  await compare(late, false);
  // The gateway has left out what the stalled one did not fetch, for nobody else's loss.
  assert.doesNotMatch(await counted.innerText(), /, 0 messages left out/);
  stalled.destroy();
  [...browsers, late].forEach(clean);
});

test("the gateway is started again, and the page comes back by itself", { timeout: 4 * PATIENCE }, async () => {
  const seen = await look(browser, address, { expected: /ERR_CONNECTION_REFUSED/ });
  await stopGateway();
  await seen.page.locator("[data-connection=lost]").waitFor();
  [gateway] = await startGateway(new URL(address).host);
  await seen.page.locator("[data-connection=open]").waitFor();
  clean(seen);
});
