// Reports beside the page: what both are made of looks the same, and a report asks nobody for anything.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build, launch } from "./browser.mjs";
import { closeBrowser, openBrowser, visit } from "./visit.mjs";

const robot = fileURLToPath(new URL("../../robots/pendulum/gym.toml", import.meta.url));
const folder = mkdtempSync(`${tmpdir()}/report-test.`);
const plumb = (...words) => execFileSync(`${build}/bin/plumb`, words, { cwd: folder, stdio: ["ignore", "ignore", "inherit"] });
// Of each component that both have: what of its style is its own, rather than its text's or its neighbours'.
const COMPONENTS = [".group > h2", ".panel", ".panel > header h3", ".panel > .what", ".panel .key li", ".panel .key i.posterior", ".panel .key i.prior.dash", ".panel thead th", ".panel tbody td", ".panel .scroll"];
const STYLE = ["color", "background-color", "font-size", "font-weight", "font-family", "line-height", "padding", "border", "border-radius", "text-align"];
const styles = (page) => page.evaluate(([components, names]) => components.map((selector) => {
  const found = document.querySelector(selector);
  return [selector, found && names.map((name) => `${name}: ${getComputedStyle(found).getPropertyValue(name)}`)];
}), [COMPONENTS, STYLE]);
let browser;

before(async () => {
  plumb("sim", robot, "--random", "--episodes", "2", "--noise", "0.01", "--csv", "swing.csv");
  plumb("calibrate", robot, "--csv", "swing.csv", "--report", "calibrate.html");
  plumb("train", robot, "--steps", "5000", "--report", "train.html");
  browser = await launch();
  await openBrowser();
});
after(async () => {
  await browser.close();
  await closeBrowser();
  rmSync(folder, { recursive: true });
});

/** A report in a browser that is told of all that is asked for and complained of. */
async function read(report, context) {
  const page = await (await browser.newContext({ viewport: { width: 1440, height: 1000 }, ...context })).newPage();
  const asked = [], complaints = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("console", (said) => complaints.push(said.text()));
  await page.goto(`file://${folder}/${report}.html`);
  assert.deepEqual([asked, complaints], [[page.url()], []]);
  return page;
}

for (const colorScheme of ["light", "dark"]) {
  test(`a report's components look as the page's, ${colorScheme}`, visit({ alarm: "" }, { colorScheme }, async ({ page }) => {
    await page.locator("#fan .key").waitFor();
    const live = await styles(page), still = await styles(await read("calibrate", { colorScheme }));
    for (const [selector, style] of live) assert.ok(style, `the page has no ${selector}`);
    assert.deepEqual(still, live);
  }));
}

test("each panel of a report says in a sentence what it shows", async () => {
  for (const report of ["calibrate", "train"]) {
    const page = await read(report);
    assert.ok((await page.locator(".panel").count()) >= 5, report);
    for (const panel of await page.locator(".panel").all())
      assert.match(await panel.locator(".what").innerText(), /^[A-Z].{20,}[.]$/s, `${report}: ${await panel.locator("h3").innerText()}`);
  }
});

test("a report is read on a phone without scrolling sideways", async () => {
  for (const report of ["calibrate", "train"]) {
    const page = await read(report, { viewport: { width: 390, height: 844 }, isMobile: true });
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), report);
  }
});
