// The page's numbers of the processes' health against those of a gateway that makes them up: every one, to all digits.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { ages, numbers, value } from "./browser.mjs";
import { closeBrowser, openBrowser, visit } from "./visit.mjs";

const STATUS = { driver: "DRIVER_STATUS", estimator: "ESTIMATOR_STATUS", controller: "CONTROLLER_STATUS", calibrator: "CALIBRATION_STATUS", trainer: "TRAINING_STATUS" };
before(openBrowser);
after(closeBrowser);

/** All rows of all tables of a panel: cells as numbers, to all digits, where they are numbers. */
const rows = (page, selector) => page.locator(selector).evaluateAll((all) => all.map((row) => [...row.cells].map((cell) => ("value" in cell.dataset ? (cell.dataset.value === "null" ? null : Number(cell.dataset.value)) : cell.textContent))));
const agesOf = async (page, processes) => ages(await Promise.all(processes.map((name) => page.locator(`[data-process=${name}] .age`).innerText())));

test("of every channel all that was counted is shown", visit({}, {}, async ({ page, mock }) => {
  const shown = await rows(page, "[data-channel]");
  const said = mock.saidOfChannels.find((all) => all[0].count === shown[0][2]);
  assert.deepEqual(shown.map((row) => row.slice(0, 8)), said.map((one) => [one.channel, one.type, one.count, one.rate, one.jitter_ms, one.bytes_per_second, one.undecodable, one.refused]));
  // As people read it, and in the colour of what is wrong.
  const cells = page.locator('[data-channel="CONTROLLER_STATUS"] td');
  assert.deepEqual((await cells.allInnerTexts()).slice(2, 7), ["8.33", "1.5", "1.50 kB", "35", "12\u202f350"]);
  assert.deepEqual(await page.locator("#channels td.bad").evaluateAll((all) => all.map((one) => Number(one.dataset.value))), said.flatMap((one) => [one.undecodable, one.refused]).filter(Boolean));
  assert.deepEqual(await page.locator('[data-channel="IMU"] td').allInnerTexts(), ["imu_t", "0", "–", "–", "–", "0", "0", "never heard"]);
}));

const OLD = { driver: 2, estimator: 150, controller: 1000, calibrator: 7200, trainer: 400 }; // [s]
test("how old each process's last word is, the gateway says", visit({ silent: true, ages: Object.fromEntries(Object.entries(OLD).map(([name, old]) => [STATUS[name], 1000 * old])) }, {}, async ({ page, mock, story }) => {
  const asked = Date.now(), shown = await agesOf(page, Object.keys(OLD));
  const passed = (Date.now() - mock.begun) / 1000;
  Object.entries(OLD).forEach(([name, old], i) => {
    const [least, most] = shown[i];
    assert.ok(most >= old && least <= old + passed, `the ${name} is ${old} to ${old + passed} s old, ${least} to ${most} s are shown`);
  });
  // They grow as time goes on, whether or not anything comes.
  story.still = true;
  await page.waitForTimeout(3000);
  const [[, most]] = await agesOf(page, ["driver"]);
  assert.ok(most >= OLD.driver + (Date.now() - asked) / 1000 - 0.5, `${most} s are shown`);
  assert.equal(await page.locator("#processes .age.old").count(), 4); // a trainer may compute for long
}));

test("a process that falls silent grows old", visit({}, {}, async ({ page, story }) => {
  await page.waitForFunction(() => /^(now|[\d.]+ ms)$/.test(document.querySelector("[data-process=driver] .age").textContent));
  const before = Date.now();
  story.silent = true;
  await page.locator("[data-process=driver] .age.old").waitFor();
  await page.waitForTimeout(2500);
  const silent = (Date.now() - before) / 1000, [[least, most]] = await agesOf(page, ["driver"]);
  assert.ok(most >= silent - 1.5 && least <= (Date.now() - before) / 1000 + 1, `silent for ${silent} s, ${least} to ${most} s are shown`);
}));

test("of every process is shown what it says, how regularly it works and what it has counted", visit({}, {}, async ({ page, mock }) => {
  const words = await page.locator("#processes tr[data-process]").evaluateAll((all) => all.map((row) => [row.dataset.process, row.cells[2].textContent, row.cells[3].textContent]));
  assert.deepEqual(words, [["driver", "idle", "12.5"], ["estimator", "the state is valid", "10"], ["controller", "running", "8.33"], ["calibrator", "iteration 6", "7.14"], ["trainer", "policy 6, complete", "6.25"], ["gateway", "1 browser, 0 messages left out for slow ones", "–"]]);
  const shown = await numbers(page, "processes");
  const of = (all, channel) => all.find((one) => one.channel === channel).intervals;
  const columns = (all) => ["JOINT_STATE", "ROBOT_STATE", "JOINT_COMMAND"].map((channel) => of(all, channel));
  const said = mock.saidOfChannels.find((all) => of(all, "ROBOT_STATE")[9] === shown[9][2] && of(all, "JOINT_STATE")[12] === shown[12][1]);
  assert.deepEqual(shown, said[0].intervals.map((_, bin) => [2 ** bin, ...columns(said).map((counts) => counts[bin])]));
  // Of a hundred of the estimator's results one takes 2048 us or more.
  assert.match(await page.locator("[data-process=estimator] td").last().innerText(), /99 % < 2\.0 ms/);
  assert.equal(await page.locator("[data-process=calibrator] td").last().innerText(), "–");
  for (const [channel, message] of Object.entries(mock.counting)) {
    const all = await page.locator(`[data-of=${channel}] [data-counter]`).all();
    assert.ok(all.length > 0, channel);
    for (const one of all) {
      const name = await one.getAttribute("data-counter");
      assert.equal(await value(one), message[name], `${channel}.${name}`);
    }
  }
  // What is bad if it happens at all.
  assert.deepEqual(await page.locator("#counted .bad dd").evaluateAll((all) => all.map((one) => one.dataset.counter)), ["refused", "outages", "episodes_aborted", "dropped_not_finite"]);
}));

const BUS = { name: "", url: "socketcan:can0", up: true, frames_received: 700, frames_sent: 350, frames_rejected: 0, frames_dropped: 0, frames_foreign: 0 };
test("a bus that is down says why, and who may command", visit({ driver: { state: 4, reason: "the CAN controller went bus-off", buses: [{ ...BUS, up: false, frames_foreign: 6 }], commands_signed: true } }, {}, async ({ page }) => {
  const line = page.locator("#bus p.line").first();
  await line.filter({ hasText: "down" }).waitFor();
  assert.equal(await line.innerText(), "socketcan:can0 is down: the CAN controller went bus-off");
  assert.equal(await page.locator("#bus .lamp.bad").count(), 1);
  await page.locator("#bus").getByText("Only commands that are signed with its key are obeyed.").waitFor();
  assert.deepEqual(await page.locator("#bus .counters .bad dd").evaluateAll((all) => all.map((one) => one.dataset.counter)), ["frames_foreign", "overruns", "measurements_lost"]);
  await page.locator("#events").getByText("fault: the CAN controller went bus-off").waitFor();
  await page.locator("#events").getByText("the bus is down").waitFor();
}));

const TWO = ["left", "right"].map((name, i) => ({ ...BUS, name, url: `socketcan:can${i}`, up: name === "left", frames_sent: 350 + i }));
test("of several buses each has its line and its counts", visit({ driver: { state: 4, reason: "bus right: the CAN interface is down", num_buses: 2, buses: TWO } }, {}, async ({ page }) => {
  await page.locator("#bus p.line").filter({ hasText: "down" }).waitFor();
  assert.deepEqual(await page.locator("#bus [data-bus] p.line").allInnerTexts(), ["left: socketcan:can0 is up", "right: socketcan:can1 is down: bus right: the CAN interface is down"]);
  assert.deepEqual(await Promise.all(TWO.map(({ url }) => value(page.locator(`[data-bus="${url}"] [data-counter=frames_sent]`)))), [350, 351]);
  await page.locator("#events").getByText("bus right is down").waitFor();
}));
