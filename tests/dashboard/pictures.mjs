// Makes the pictures of docs/page.md: `node tests/dashboard/pictures.mjs docs/images`. The hopper's loop in virtual time, looked
// at while its second policy is judged.
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { launch, look } from "./browser.mjs";
import { startLoop } from "./loop.mjs";

const PICTURES = { now: ["robot", {}], learnt: ["learning", {}], policies: ["policies", {}], health: ["health", { colorScheme: "dark" }] };
const [images = "docs/images"] = process.argv.slice(2);
const folder = mkdtempSync(`${tmpdir()}/page-pictures.`);
const browser = await launch();
const { loop, ended, address } = await startLoop("hopper", ["--seed", "1", "--iterations", "2", "--evaluation-episodes", "20", "--speed", "2"], folder, 20000 + (process.pid % 20000));
try {
  const light = await look(browser, address, { viewport: { width: 1280, height: 900 }, colorScheme: "light" });
  await light.page.locator('[data-process="trainer"]', { hasText: "policy 2, complete" }).waitFor({ timeout: 600_000 });
  const dark = await look(browser, address, { viewport: { width: 1280, height: 900 }, colorScheme: "dark" });
  await dark.page.locator("[data-driver=armed]").waitFor();
  const inSpace = light.page.getByRole("button", { name: "in space" });
  if (await inSpace.count()) await inSpace.click();
  await light.page.waitForTimeout(10_000); // ten seconds of motion, to be seen
  for (const [section, [name, { colorScheme }]] of Object.entries(PICTURES)) {
    const { page } = colorScheme === "dark" ? dark : light;
    await page.locator(`#${section}`).scrollIntoViewIfNeeded();
    await page.evaluate((id) => document.getElementById(id).scrollIntoView({ block: "start" }), section);
    await page.waitForTimeout(1000);
    await page.screenshot({ path: `${images}/page-${name}.png` });
  }
  const phone = await look(browser, address, { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true });
  await phone.page.waitForTimeout(3000);
  await phone.page.screenshot({ path: `${images}/page-phone.png` });
} finally {
  await browser.close();
  loop.kill("SIGINT");
  await ended;
  rmSync(folder, { recursive: true });
}
