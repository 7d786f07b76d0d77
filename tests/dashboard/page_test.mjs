// The page against a gateway that makes its data up: what it shows, what a person may do on it, and that it comes back.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { clean, numbers, pageFolder } from "./browser.mjs";
import { serve } from "./mock.mjs";
import { closeBrowser, lookAt, openBrowser, visit } from "./visit.mjs";

const PANELS = ["robot", "motion", "posterior", "pairs", "fan", "update", "gap", "returns", "training", "processes", "cycle", "bus", "counted", "channels", "events"];
const ALARM = "the model cannot explain this log: <b>pivot</b>";
before(openBrowser);
after(closeBrowser);

test("every panel says in a sentence what it shows, and shows something", visit({ alarm: ALARM }, {}, async ({ page }) => {
  await page.locator("#posterior .parameter").first().waitFor();
  for (const id of PANELS) {
    assert.match(await page.locator(`#${id} .what`).innerText(), /^[A-Z].{30,}[.]$/s, id);
    assert.equal(await page.locator(`#${id} p.empty`).count(), 0, id);
  }
  // Each plot has a name for those who do not see it.
  assert.equal(await page.locator("[role=img]:not([aria-label]), canvas.picture:not([aria-label])").count(), 0);
  await page.waitForFunction(() => document.querySelectorAll(".chart canvas").length === 15);
}));

test("the page is loaded quickly: 60 kB before anything is drawn in space", () => {
  const size = ["index.html", "page.js", "page.css", "favicon.svg"].reduce((sum, file) => sum + readFileSync(`${pageFolder}/${file}.gz`).length, 0);
  assert.ok(size <= 60_000, `${size} bytes`);
});

test("what is said from outside is text, whatever it looks like", visit({ alarm: ALARM }, {}, async ({ page }) => {
  await page.locator("[data-alarm].bad").waitFor();
  assert.match(await page.locator("[data-alarm]").innerText(), /<b>pivot<\/b>/);
  assert.match(await page.locator("#events").innerText(), /<b>pivot<\/b>/);
}));

test("what is null is a dash", visit({}, {}, async ({ page }) => {
  const supply = page.locator("#bus table").first().locator("tbody tr").first().locator("td").nth(4);
  assert.equal(await supply.innerText(), "–");
  assert.equal(await supply.getAttribute("data-value"), "null");
}));

test("a posterior a thousandth of the prior's width is seen, and the prior's width is said", visit({}, { expected: /willReadFrequently/ }, async ({ page }) => {
  const narrow = page.locator('[data-parameter="friction/pivot"]');
  await narrow.waitFor();
  assert.match(await narrow.locator(".aside").innerText(), /prior 0\.050 ± 0\.030: \d+ times wider/);
  // The share of the plot's height, at the newest iteration, in which the posterior's blue is seen.
  const blue = (least, most) => page.waitForFunction(([low, high]) => {
    const canvas = document.querySelector('[data-parameter="friction/pivot"] canvas');
    const { data, width, height } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const x = Math.floor(width * 0.85);
    let rows = 0;
    for (let y = 0; y < height; y++) {
      const [red, , blue, opaque] = data.slice(4 * (y * width + x));
      if (opaque && blue > red - 8) rows++; // the prior's band is far redder
    }
    return rows / height > low && rows / height < high;
  }, [least, most]);
  await blue(0.2, 0.9);
  await page.locator("#posterior").getByRole("button", { name: "prior", exact: true }).click();
  await blue(0, 0.1);
}));

test("a trial that was cut short counts as a whole episode, one that fell as it is", visit({}, {}, async ({ page }) => {
  await page.locator("#returns .chart canvas").waitFor();
  assert.deepEqual((await numbers(page, "returns", 1)).slice(0, 3), [[0, 1, 200, -300, -300], [0, 2, 100, -280, -305], [0, 3, 150, -330, -330]]);
}));

test("what the robot returns in the end is the incumbent's, whose policy runs then", visit({ judged: true }, {}, async ({ page }) => {
  await page.locator("#returns .chart canvas").waitFor();
  const [fifth, sixth] = (await numbers(page, "returns")).slice(-2);
  assert.deepEqual([fifth[0], fifth[2], fifth[3]], [5, 6, -170]);
  assert.deepEqual(sixth.slice(0, 4), [6, null, 0, -152]);
}));

test("the discrepancy that was learnt is told", visit({ alarm: ALARM }, {}, async ({ page }) => {
  const table = page.locator("#gap table").filter({ hasText: "learnt, rms" });
  const cells = await table.locator("tbody tr").first().locator("td").evaluateAll((all) => all.map((one) => one.dataset.value ?? one.textContent));
  assert.equal(cells[0], "pivot [rad]");
  assert.ok(Number(cells[1]) > 0);
  assert.equal(Number(cells[2]), 1e-3);
  assert.equal(Number(cells[3]), 0.0106);
}));

test("Esc stops, whatever is open, and the answer is shown", visit({}, {}, async ({ page, mock }) => {
  await page.getByRole("button", { name: "Arm…" }).click();
  await page.getByRole("dialog").waitFor();
  await page.keyboard.press("Escape");
  await page.locator(".outcome .done").waitFor();
  assert.deepEqual(mock.asked, ["emergency_stop"]);
  assert.match(await page.locator(".outcome").innerText(), /stopped by request/);
  assert.equal(await page.getByRole("dialog").count(), 0);
  await page.locator("[data-driver=fault]").waitFor();
}));

test("arming asks twice, and not at all who may not", visit({ robot: { may_control: true } }, {}, async ({ page, mock }) => {
  await page.getByRole("button", { name: "Arm…" }).click();
  const arm = page.getByRole("dialog").getByRole("button", { name: "Arm", exact: true });
  assert.ok(await arm.isDisabled());
  await page.getByRole("checkbox").check();
  await arm.click();
  await page.locator("[data-driver=armed]").waitFor();
  await page.getByRole("button", { name: "Disarm" }).click();
  await page.locator("[data-driver=idle]").waitFor();
  assert.deepEqual(mock.asked, ["arm", "disarm"]);
}));

test("a run that may only be looked at says why", visit({ clock: "virtual" }, {}, async ({ page, mock }) => {
  await page.getByText("a run in virtual time hears nobody").waitFor();
  assert.ok(await page.getByRole("button", { name: "Arm…" }).isDisabled());
  await page.getByRole("button", { name: /Emergency stop/ }).click();
  await page.locator(".outcome .done").waitFor();
  assert.deepEqual(mock.asked, ["emergency_stop"]);
}));

test("whoever may not arm may disarm", visit({ robot: { may_control: false, why_not: "without the token" }, driver: { state: 3 } }, {}, async ({ page, mock }) => {
  await page.getByRole("button", { name: "Disarm" }).click();
  await page.locator(".outcome .done").waitFor();
  assert.ok(await page.getByRole("button", { name: "Arm…" }).isDisabled());
  assert.deepEqual(mock.asked, ["disarm"]);
}));

test("in virtual time nobody may disarm", visit({ robot: { may_control: false }, driver: { state: 3 }, clock: "virtual" }, {}, async ({ page }) => {
  await page.locator("[data-driver=armed]").waitFor();
  await page.locator("[data-clock=virtual]").waitFor();
  assert.ok(await page.getByRole("button", { name: "Disarm" }).isDisabled());
}));

test("the late answer to an earlier wish does not hide that to a stop", visit({ late: "arm" }, {}, async ({ page, story }) => {
  await page.getByRole("button", { name: "Arm…" }).click();
  await page.getByRole("checkbox").check();
  await page.getByRole("dialog").getByRole("button", { name: "Arm", exact: true }).click();
  await page.locator(".outcome .asked").waitFor();
  await page.keyboard.press("Escape");
  await page.locator(".outcome .done").waitFor();
  story.answerLate();
  await page.locator("#events").getByText(/^Arm: /).waitFor();
  assert.match(await page.locator(".outcome").innerText(), /Emergency stop.*stopped by request/);
}));

test("a page of another robot than the run's says so", visit({ robot: { name: "hopper" } }, {}, async ({ page }) => {
  await page.getByRole("alert").filter({ hasText: "The driver that is heard is of pendulum, and this page of hopper" }).waitFor();
}));

test("a wish to place the robot is shown, and confirmed", visit({ placing: true }, {}, async ({ page, mock }) => {
  await page.getByText("Place the robot").waitFor();
  assert.match(await page.locator(".placing").innerText(), /pivot \[rad\] −0\.773, moving with pivot \[rad\/s\] 0\.812/);
  await page.getByRole("button", { name: "It is placed" }).click();
  await page.locator(".outcome .done").waitFor();
  assert.deepEqual(mock.asked, ["confirm_placed"]);
}));

test("it says when it is not connected, and comes back with all that was said", async () => {
  const mock = await serve(pageFolder, 0, {});
  const seen = await lookAt(mock.url, { expected: /ERR_CONNECTION_REFUSED/ });
  await seen.page.locator("#posterior .parameter").first().waitFor();
  const shown = await numbers(seen.page, "posterior");
  await mock.close();
  await seen.page.getByRole("alert").filter({ hasText: "Not connected" }).waitFor();
  await seen.page.getByRole("button", { name: /Emergency stop/ }).click();
  await seen.page.locator(".outcome .failed").filter({ hasText: "robot's own emergency stop" }).waitFor();
  const again = await serve(pageFolder, mock.port, {});
  await seen.page.locator("[data-connection=open]").waitFor();
  await seen.page.locator("#posterior .parameter").first().waitFor();
  assert.deepEqual(await numbers(seen.page, "posterior"), shown);
  await seen.page.context().close();
  await again.close();
  clean(seen);
});

test("it fits a phone, with the stop in reach", visit({ alarm: ALARM, placing: true }, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: "dark" }, async ({ page, mock }) => {
  await page.locator("#posterior .parameter").first().waitFor();
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
  for (const at of ["robot", "channels"]) {
    await page.evaluate((id) => document.getElementById(id).scrollIntoView(), at);
    const box = await page.getByRole("button", { name: /Emergency stop/ }).boundingBox();
    assert.ok(box.height >= 44 && box.width > 300 && box.y + box.height <= 844, at);
  }
  await page.getByRole("button", { name: /Emergency stop/ }).tap();
  await page.locator(".outcome .done").waitFor();
  assert.deepEqual(mock.asked, ["emergency_stop"]);
}));

test("keys lead through the page", visit({}, {}, async ({ page }) => {
  await page.keyboard.press("4");
  await page.waitForFunction(() => document.activeElement.id === "health");
  await page.keyboard.press("?");
  await page.getByRole("dialog").getByText("emergency stop, always").waitFor();
  await page.getByRole("button", { name: "Close" }).click();
  assert.equal(await page.getByRole("dialog").count(), 0);
}));

test("the robot is drawn in space when that is asked for", visit({}, {}, async ({ page }) => {
  await page.getByRole("button", { name: "in space" }).click();
  const canvas = page.locator("canvas.picture");
  await page.waitForFunction(() => document.querySelector("canvas.picture").getContext("webgl2") !== null);
  const before = await canvas.screenshot();
  await page.waitForFunction(() => performance.getEntriesByName(`${location.origin}/robot.js`).length === 1);
  assert.notDeepEqual(await canvas.screenshot(), before);
}));
