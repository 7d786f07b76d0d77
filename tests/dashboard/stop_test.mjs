// A loop in real time, and a person's emergency stop from the page: the driver disarms, and says so on the page.
import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { test } from "node:test";
import { clean, launch, look, PATIENCE } from "./browser.mjs";
import { startLoop } from "./loop.mjs";

test("the emergency stop of a live loop", { timeout: 4 * PATIENCE }, async () => {
  const folder = mkdtempSync(`${tmpdir()}/page-stop.`);
  const { loop, ended, address } = await startLoop("pendulum", ["--real-time"], folder, 20000 + (process.pid % 20000));
  const browser = await launch();
  try {
    const seen = await look(browser, address, { expected: /ERR_CONNECTION_REFUSED/ });
    await seen.page.locator("[data-driver=armed]").waitFor();
    await seen.page.keyboard.press("Escape");
    await seen.page.locator(".outcome .done").waitFor();
    assert.match(await seen.page.locator(".outcome").innerText(), /Emergency stop/);
    await seen.page.locator("#events").filter({ hasText: /driver\s*fault/ }).waitFor();
    clean(seen);
  } finally {
    await browser.close();
    loop.kill("SIGINT");
    await ended;
    rmSync(folder, { recursive: true });
  }
});
