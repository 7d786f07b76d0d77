// The page's numbers of the processes' health against those of a gateway that makes them up: every one, to all digits.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { ages } from "./browser.mjs";
import { closeBrowser, openBrowser, visit } from "./visit.mjs";

const STATUS = { driver: "DRIVER_STATUS", estimator: "ESTIMATOR_STATUS", controller: "CONTROLLER_STATUS", calibrator: "CALIBRATION_STATUS", trainer: "TRAINING_STATUS" };
before(openBrowser);
after(closeBrowser);

/** All rows of all tables of a panel: cells as numbers, to all digits, where they are numbers. */
const rows = (page, selector) => page.locator(selector).evaluateAll((all) => all.map((row) => [...row.cells].map((cell) => ("value" in cell.dataset ? (cell.dataset.value === "null" ? null : Number(cell.dataset.value)) : cell.textContent))));
const agesOf = async (page, processes) => ages(await Promise.all(processes.map((name) => page.locator(`[data-process=${name}] .age`).innerText())));

test("of every channel all that was counted is shown", visit({}, {}, async ({ page, mock }) => {
  await page.locator("[data-channel]").first().waitFor();
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
  await page.locator("[data-channel]").first().waitFor();
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
  await page.locator("[data-channel]").first().waitFor();
  await page.waitForFunction(() => /^(now|[\d.]+ ms)$/.test(document.querySelector("[data-process=driver] .age").textContent));
  const before = Date.now();
  story.silent = true;
  await page.locator("[data-process=driver] .age.old").waitFor();
  await page.waitForTimeout(2500);
  const silent = (Date.now() - before) / 1000, [[least, most]] = await agesOf(page, ["driver"]);
  assert.ok(most >= silent - 1.5 && least <= (Date.now() - before) / 1000 + 1, `silent for ${silent} s, ${least} to ${most} s are shown`);
}));
