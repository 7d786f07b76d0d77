// What the page must show of a run: its log, decoded by lcm-gen's Python types, and each panel's numbers compared with that.
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { build, numbers, value } from "./browser.mjs";

const STATES = ["absent", "idle", "arming", "armed", "fault"];
const EVALUATE = 1; // of policy_t
const EPISODE = 200; // steps: robots/pendulum/robot.toml

/** The messages of a log in the order in which they were received: [{received, channel, message}]. */
export async function read(log) {
  const script = fileURLToPath(new URL("log_json.py", import.meta.url));
  const { stdout } = await promisify(execFile)("/usr/bin/python3", [script, `${build}/lcmtypes/python`, log], { maxBuffer: 1e9 });
  return stdout.trim().split("\n").map((line) => JSON.parse(line));
}

const near = (shown, meant, what, tolerance = 1e-9) => assert.ok(shown === meant || Math.abs(shown - meant) <= tolerance * Math.abs(meant), `${what}: ${shown} is shown, ${meant} was said`);
const differs = (all, pick) => all.filter((one, i) => i === 0 || pick(one) !== pick(all[i - 1]));
/** The last of each key, by key. */
const lastOf = (all, key) => new Map(all.map((one) => [key(one), one]));

/** What the page tells of a run, by who said it, the newest first. */
function events({ DRIVER_STATUS, CALIBRATION_STATUS, TRAINING_STATUS }) {
  const because = (reason) => (reason ? `: ${reason}` : "");
  const calibrator = [];
  let before = { iteration: 0, alarm: "", gap: "" };
  for (const one of CALIBRATION_STATUS) {
    if (one.iteration > before.iteration) calibrator.push(`iteration ${one.iteration}: ${one.transitions} transitions`);
    if (one.alarm !== before.alarm) calibrator.push(one.alarm || "the alarm has ended");
    if (one.gap && one.gap !== before.gap) calibrator.push(one.gap);
    before = one;
  }
  const decisions = differs(TRAINING_STATUS, (one) => one.decision).map((one) => one.decision).filter(Boolean);
  return {
    driver: differs(DRIVER_STATUS, (one) => `${one.state} ${one.reason}`).map((one) => STATES[one.state] + because(one.reason)).reverse(),
    calibrator: calibrator.reverse(),
    decisions: decisions.reverse(),
    trained: [...new Set(TRAINING_STATUS.filter((one) => one.complete).map((one) => `policy ${one.iteration} is trained`))].reverse(),
  };
}

async function compareEvents(page, said) {
  const shown = await page.locator("#events li").evaluateAll((all) => all.map((one) => [...one.querySelectorAll("b, span")].map((part) => part.textContent)));
  const of = (who) => shown.filter(([from]) => from === who).map(([, text]) => text);
  const { driver, calibrator, decisions, trained } = events(said);
  assert.deepEqual(of("driver"), driver);
  assert.deepEqual(of("calibrator"), calibrator);
  assert.deepEqual(of("trainer").filter((text) => / is trained$/.test(text)), trained);
  assert.deepEqual(of("trainer").filter((text) => !/ is trained$/.test(text)), decisions);
}

async function compareDriver(page, status) {
  await page.waitForFunction((cycles) => document.querySelector("[data-counter=cycles]")?.dataset.value === String(cycles), status.cycles);
  const bins = await numbers(page, "cycle");
  status.lateness.forEach((count, i) => near(bins[i][1], count, `lateness, bin ${i}`));
  status.phase_duration.forEach((phase, p) => phase.forEach((count, i) => near(bins[i][2 + p], count, `${status.phase_name[p]}, bin ${i}`)));
}

async function compareCounters(page, said) {
  const measurements = said.ESTIMATOR_STATUS.at(-1).measurements;
  await page.waitForFunction((meant) => document.querySelector("[data-counter=measurements]")?.dataset.value === String(meant), measurements);
  for (const channel of ["DRIVER_STATUS", "ESTIMATOR_STATUS", "CONTROLLER_STATUS", "CALIBRATION_STATUS"]) {
    const shown = await page.locator(`[data-of=${channel}] [data-counter]`).evaluateAll((all) => all.map((one) => [one.dataset.counter, Number(one.dataset.value)]));
    assert.ok(shown.length > 0, channel);
    for (const [name, count] of shown) near(count, said[channel].at(-1)[name], `${name} of ${channel}`);
  }
}

async function comparePosterior(page, { CALIBRATION_STATUS, PARAMETER_DISTRIBUTION }, posteriors) {
  const status = lastOf(CALIBRATION_STATUS, (one) => one.iteration);
  const names = PARAMETER_DISTRIBUTION[0].name;
  const shown = await numbers(page, "posterior");
  assert.deepEqual(shown.map(([iteration, name]) => [iteration, name]), [...posteriors.keys()].flatMap((iteration) => names.map((name) => [iteration, name])));
  for (const [iteration, name, mean, sd, ...rest] of shown) {
    const at = names.indexOf(name);
    const meant = [status.get(iteration).mean[at], status.get(iteration).sd[at], ...posteriors.get(iteration).quantiles[at], status.get(0).mean[at], status.get(0).sd[at]];
    [mean, sd, ...rest].forEach((one, i) => near(one, meant[i], `${name}, iteration ${iteration}, number ${i}`, 1e-7));
  }
  // Of 200 samples: five times their standard error, and what the coordinates' logarithm bends.
  const { correlation } = [...posteriors.values()].at(-1);
  (await numbers(page, "pairs")).forEach(([, ...row], i) => row.forEach((r, j) =>
    assert.ok(Math.abs(r - correlation[i][j]) <= (5 * (1 - correlation[i][j] ** 2)) / Math.sqrt(200) + 0.03, `correlation of ${names[i]} and ${names[j]}: ${r}, not ${correlation[i][j]}`)));
}

async function compareGap(page, learnt, distribution) {
  const newest = learnt.at(-1);
  assert.deepEqual(await numbers(page, "gap"), learnt.map((one) => [one.iteration, one.discrepancy, one.prior_discrepancy]));
  const alarm = page.locator("[data-alarm]");
  assert.equal(await alarm.innerText(), newest.alarm ? `Alarm\n${newest.alarm}` : "No alarm\nThe model explains what was recorded.");
  assert.deepEqual(await page.locator("#gap p.line").allInnerTexts(), [newest.gap, newest.identifiability && `${newest.identifiability}.`].filter(Boolean));
  const cells = (caption) => page.locator("#gap table").filter({ hasText: caption }).locator("tbody tr").evaluateAll((all) => all.map((row) => [...row.cells].map((cell) => ("value" in cell.dataset ? Number(cell.dataset.value) : cell.textContent))));
  assert.deepEqual(await cells("What the motion determines"), newest.combination.map((name, i) => [name, newest.combination_mean[i], newest.combination_sd[i]]));
  const tables = await cells("learnt, rms");
  const meant = distribution.residual.flatMap(({ noise, bound, num_outputs: n }) => bound.map((most, i) => [Math.hypot(...noise.slice(i * n, (i + 1) * n)), most]));
  assert.equal(tables.length, meant.length);
  // Which are floats.
  tables.forEach(([, , left, most], i) => {
    near(left, meant[i][0], `noise that is left, ${i}`, 1e-7);
    near(most, meant[i][1], `the largest change, ${i}`, 1e-7);
  });
}

async function compareReturns(page, { CONTROLLER_STATUS, POLICY, TRAINING_STATUS }) {
  const whole = (one, i) => (one.fell[i] || one.steps[i] >= EPISODE ? one.returns[i] : one.returns[i] + one.late_rate[i] * (EPISODE - one.steps[i]));
  const trainedIn = lastOf(POLICY, (one) => one.iteration), robot = new Map();
  for (const one of lastOf(CONTROLLER_STATUS.filter((one) => one.policy_iteration >= 0), (one) => one.policy_iteration).values()) {
    const policy = one.purpose === EVALUATE ? trainedIn.get(one.policy_iteration).trained_in : one.policy_iteration;
    if (one.returns.length) robot.set(policy, [...(robot.get(policy) ?? []), ...one.returns.map((sum, i) => [one.steps[i], sum, whole(one, i)])]);
  }
  const inOrder = [...robot].sort(([a], [b]) => a - b);
  assert.deepEqual(await numbers(page, "returns", 1), inOrder.flatMap(([policy, all]) => all.map((one, i) => [policy, i + 1, ...one])));
  const complete = lastOf(TRAINING_STATUS.filter((one) => one.complete), (one) => one.iteration);
  const rows = await numbers(page, "returns");
  assert.deepEqual(rows.map(([policy]) => policy), [...new Set([...robot.keys(), ...complete.keys()])].sort((a, b) => a - b));
  for (const [policy, mean, episodes, ...simulated] of rows) {
    const all = robot.get(policy) ?? [], one = complete.get(policy);
    assert.equal(episodes, all.length);
    if (all.length) near(mean, all.reduce((sum, [, , whole]) => sum + whole, 0) / all.length, `mean return of policy ${policy}`);
    assert.deepEqual(simulated, one ? [one.evaluation_return, one.evaluation_tenth, one.evaluation_worst] : [null, null, null]);
  }
}

async function compareMotion(page, { ROBOT_STATE }) {
  const [[, measured, predicted]] = await numbers(page, "motion");
  const end = ROBOT_STATE.at(-1).utime;
  // Predictions are made 50 times a second at most, of a log that goes faster.
  const of = ROBOT_STATE.filter((one) => one.utime > end - 2e6).find((one) => one.q[0] === measured);
  assert.ok(of, `${measured} was measured in the last seconds`);
  assert.ok(Math.abs(predicted - measured) < 0.02, `${predicted} was predicted where ${measured} was measured`);
}

/** Every panel's numbers are those that were said last, or of each iteration. @param messages of the log. */
export async function compare({ page }, messages, { fast = true, counted = true } = {}) {
  const said = {}, posteriors = new Map();
  for (const { channel, message, posterior } of messages) {
    (said[channel] ??= []).push(message);
    if (posterior) posteriors.set(message.iteration, posterior);
  }
  const last = (channel) => said[channel].at(-1);
  await compareDriver(page, last("DRIVER_STATUS"));
  await compareCounters(page, said);
  const learnt = [...lastOf(said.CALIBRATION_STATUS, (one) => one.iteration).values()].filter((one) => one.iteration > 0);
  assert.deepEqual(await numbers(page, "update"), learnt.map((one) => [one.iteration, one.kl, one.ess, one.temperature, one.transitions, one.rollouts, one.seconds]));
  assert.deepEqual(await numbers(page, "fan"), learnt.flatMap((one) => one.horizon.map((n, i) => [one.iteration, n, one.error_prior[i], one.error_before[i], one.error_after[i]])));
  await comparePosterior(page, said, posteriors);
  await compareGap(page, learnt, last("PARAMETER_DISTRIBUTION"));
  const updates = [...lastOf(said.TRAINING_STATUS, (one) => `${one.iteration} ${one.update}`).values()];
  assert.deepEqual(await numbers(page, "training"), updates.slice(-200).map((one) => [one.iteration, one.update, one.steps, one.mean_return, one.kl, one.surrogate_gain, one.explained_variance, one.entropy]));
  await compareReturns(page, said);
  near(await value(page.locator("[data-episode] [data-value]").last()), last("CONTROLLER_STATUS").episode_return, "return so far");
  await compareEvents(page, said);
  for (const channel of Object.keys(said)) {
    const row = page.locator(`[data-channel="${channel}"] td`);
    if (counted) near(await value(row.nth(1)), said[channel].length, `messages of ${channel}`);
    near(await value(row.nth(5)), 0, `undecodable of ${channel}`);
  }
  if (!fast) return;
  near(await value(page.locator("table.state td").first()), last("ROBOT_STATE").q[0], "position");
  near(await value(page.locator("table.state td").nth(2)), last("ROBOT_STATE").v[0], "velocity");
  await compareMotion(page, said);
}

/** All numbers and events that a page shows of the run, whatever they are. */
export async function everything({ page }) {
  const shown = {};
  for (const panel of ["update", "fan", "posterior", "pairs", "gap", "training", "returns", "cycle"]) shown[panel] = await numbers(page, panel);
  for (const list of ["#events", "[data-alarm]", "#bus"]) shown[list] = await page.locator(list).innerText();
  return shown;
}
