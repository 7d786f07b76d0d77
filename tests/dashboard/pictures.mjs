// Makes the pictures of docs/page.md: `node tests/dashboard/pictures.mjs docs/images`. The hopper's loop in virtual time, no
// faster than real time, looked at while its second policy is judged.
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { launch, look } from "./browser.mjs";
import { startLoop } from "./loop.mjs";

const DESK = { viewport: { width: 1280, height: 900 } };
const PICTURES = [
  ["learning", "learnt", { ...DESK, colorScheme: "light" }],
  ["policies", "policies", { ...DESK, colorScheme: "light" }],
  ["health", "health", { ...DESK, colorScheme: "dark" }],
  ["phone", "now", { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, colorScheme: "dark" }],
  ["robot", "now", { ...DESK, colorScheme: "light" }],
];

const [images = "docs/images"] = process.argv.slice(2);
const folder = mkdtempSync(`${tmpdir()}/page-pictures.`);
const browser = await launch();
const { loop, ended, address } = await startLoop("hopper", ["--seed", "1", "--iterations", "2", "--evaluation-episodes", "40", "--speed", "1"], folder, 20000 + (process.pid % 20000));
try {
  const { page: waiting } = await look(browser, address);
  await waiting.locator('[data-process="trainer"]', { hasText: "policy 2, complete" }).waitFor({ timeout: 900_000 });
  await waiting.locator("[data-driver=armed]").waitFor();
  await waiting.context().close();
  for (const [name, section, context] of PICTURES) {
    const { page } = await look(browser, address, context);
    await page.locator("#channels tbody tr").first().waitFor();
    if (name === "robot") {
      await page.getByRole("button", { name: "in space" }).click();
      await page.waitForTimeout(10_000); // of motion, to be seen
    }
    await page.evaluate((id) => document.getElementById(id).scrollIntoView({ block: "start", behavior: "instant" }), section);
    await page.waitForTimeout(2000);
    await page.screenshot({ path: `${images}/page-${name}.png`, animations: "disabled" });
    await page.context().close();
  }
} finally {
  await browser.close();
  loop.kill("SIGINT");
  await ended;
  rmSync(folder, { recursive: true });
}
