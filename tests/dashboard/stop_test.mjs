// A loop in real time, and a person's emergency stop from the page: the driver disarms, and says so on the page.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { createInterface } from "node:readline";
import { test } from "node:test";
import { build, clean, launch, look, PATIENCE } from "./browser.mjs";

const source = process.env.PLUMBLINE_SOURCE ?? new URL("../..", import.meta.url).pathname;

test("the emergency stop of a live loop", { timeout: 4 * PATIENCE }, async () => {
  const folder = mkdtempSync(`${tmpdir()}/page-stop.`), port = 20000 + (process.pid % 20000);
  const loop = spawn(`${build}/bin/plumb`, ["launch", `${source}/robots/pendulum`, "--real-time", "--dashboard", "127.0.0.1:0", "--output", `${folder}/run`, "--bus", `udp:239.74.163.2:${port + 20000}`,
    "--lcm-url", `udpm://239.255.76.67:${port}?ttl=0&recv_buf_size=2097152`], { stdio: ["ignore", "pipe", "inherit"] });
  const ended = new Promise((resolve) => loop.once("exit", resolve));
  const browser = await launch();
  try {
    let address;
    for await (const line of createInterface({ input: loop.stdout })) {
      address = /http:\/\/\S+/.exec(line)?.[0];
      if (address) break;
    }
    loop.stdout.resume();
    const seen = await look(browser, address, { expected: /ERR_CONNECTION_REFUSED/ });
    await seen.page.locator("[data-driver=armed]").waitFor();
    await seen.page.keyboard.press("Escape");
    await seen.page.locator(".outcome .done").waitFor();
    assert.match(await seen.page.locator(".outcome").innerText(), /Emergency stop/);
    assert.match(await seen.page.locator("#events").innerText(), /driver\s+fault/);
    clean(seen);
  } finally {
    await browser.close();
    loop.kill("SIGINT");
    await ended;
    rmSync(folder, { recursive: true });
  }
});
