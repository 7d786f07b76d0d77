// Builds the page into the folder given (../../build/dashboard/page): page.js, page.css, robot.js,
// index.html, favicon.svg, and each of them compressed beside it.
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, renameSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const folder = process.argv[2] ?? here("../../build/dashboard/page");
mkdirSync(folder, { recursive: true });
await build({
  entryPoints: { page: here("src/main.tsx"), robot: here("src/robot/space.ts"), "page-style": here("style/page.css") },
  outdir: folder,
  bundle: true, minify: true, format: "esm", target: "es2023", jsx: "automatic", jsxImportSource: "preact",
  legalComments: "none", logLevel: "warning", charset: "utf8",
});
// An entry point of its own name would write over the script's.
renameSync(`${folder}/page-style.css`, `${folder}/page.css`);
for (const file of ["index.html", "favicon.svg"]) copyFileSync(here(`src/${file}`), `${folder}/${file}`);
for (const file of ["page.js", "page.css", "robot.js", "index.html", "favicon.svg"]) writeFileSync(`${folder}/${file}.gz`, gzipSync(readFileSync(`${folder}/${file}`), { level: 9 }));
