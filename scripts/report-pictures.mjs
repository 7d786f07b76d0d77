// Makes the pictures of reports in the documents: `node scripts/report-pictures.mjs docs/images`. Wants scripts/setup --page and --browser.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { fileURLToPath } from "node:url";
import { build, launch } from "../tests/dashboard/browser.mjs";

const [images = "docs/images"] = process.argv.slice(2);
const folder = mkdtempSync(`${tmpdir()}/report-pictures.`);
const robots = fileURLToPath(new URL("../robots", import.meta.url));
const plumb = (...words) => execFileSync(`${build}/bin/plumb`, words, { cwd: folder, stdio: "ignore" });

plumb("sim", `${robots}/pendulum/gym.toml`, "--random", "--episodes", "3", "--noise", "0.01", "--csv", "swing.csv");
plumb("calibrate", `${robots}/pendulum/gym.toml`, "--csv", "swing.csv", "--report", "pendulum.html");
plumb("sim", `${robots}/hopper/gym.toml`, "--random", "--episodes", "60", "--seed", "3", "--noise", "0.003", "--csv", "hop.csv");
plumb("calibrate", `${robots}/hopper/gym.toml`, "--csv", "hop.csv", "--report", "hopper.html");
plumb("train", `${robots}/pendulum`, "--steps", "3e5", "--evaluate-every", "5", "--report", "training.html");
plumb("launch", `${robots}/pendulum`, "--iterations", "4", "--report", "run.html");

const browser = await launch();
const desk = { viewport: { width: 1140, height: 900 } };
const phone = { viewport: { width: 390, height: 844 }, isMobile: true };
const PICTURES = [ // file, page, how it is looked at, panel by its title; none: the beginning of the page
  ["report-pairs-pendulum", "pendulum", desk, "Prior and posterior"],
  ["report-pairs-hopper", "hopper", desk, "Prior and posterior"],
  ["report-fit-pendulum", "pendulum", desk, "Residuals"],
  ["report-training", "training", { ...desk, viewport: { width: 1140, height: 1000 } }, ""],
  ["report-run", "run", { ...desk, viewport: { width: 1140, height: 1000 } }, ""],
  ["report-phone", "hopper", { ...phone, colorScheme: "dark" }, ""],
];
try {
  for (const [file, name, context, heading] of PICTURES) {
    const page = await (await browser.newContext({ colorScheme: "light", ...context })).newPage();
    await page.goto(`file://${folder}/${name}.html`);
    const picture = { path: `${images}/${file}.png` };
    if (heading) await page.locator("section.panel", { has: page.getByRole("heading", { name: heading, exact: true }) }).screenshot(picture);
    else await page.screenshot(picture);
  }
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
