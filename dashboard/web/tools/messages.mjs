// Makes src/messages.ts from lcmtypes/: the messages as the gateway's JSON has them, NaN as null. With --check it changes
// nothing and fails if the file is not what it would write.
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const types = new URL("../../../lcmtypes/", import.meta.url);
const target = new URL("../src/messages.ts", import.meta.url);
const PLAIN = { double: "number | null", float: "number | null", boolean: "boolean", string: "string" };

/** @param {string} kind of lcm-gen @param {number} dimensions matrices are flattened */
function typeScript(kind, dimensions) {
  const one = PLAIN[kind] ?? (/^(int\d+_t|byte)$/.test(kind) ? "number" : kind);
  return dimensions === 0 ? one : one.includes(" ") ? `(${one})[]` : `${one}[]`;
}

function oneMessage(file) {
  const text = readFileSync(new URL(file, types), "utf8").replace(/\/\/.*$/gm, "");
  const [, name, body] = /struct\s+(\w+)\s*\{(.*)\}/s.exec(text) ?? [];
  if (!name) throw new Error(`${file}: no struct`);
  const fields = [];
  const constants = [];
  for (const statement of body.split(";").map((part) => part.trim()).filter(Boolean)) {
    const constant = /^const\s+\S+\s+(\w+)\s*=\s*(-?\d+)$/.exec(statement);
    const field = /^(\w+)\s+(\w+)((?:\[\w+\])*)$/.exec(statement);
    if (constant) constants.push(`${constant[1]}: ${constant[2]}`);
    else if (field) fields.push(`  ${field[2]}: ${typeScript(field[1], field[3].split("[").length - 1)};`);
    else throw new Error(`${file}: what is "${statement}"?`);
  }
  const named = constants.length ? `export const ${name} = { ${constants.join(", ")} } as const;\n` : "";
  return `export interface ${name} {\n${fields.join("\n")}\n}\n${named}`;
}

const files = readdirSync(types).filter((file) => file.endsWith(".lcm") && !file.startsWith("lockstep_")).sort();
const text = `// Made by tools/messages.mjs from lcmtypes/: units and meanings are in docs/messages.md.\n\n${files.map(oneMessage).join("\n")}`;
if (!process.argv.includes("--check")) {
  writeFileSync(target, text);
} else if (readFileSync(target, "utf8") !== text) {
  console.error(`${fileURLToPath(target)} is not what lcmtypes/ says: npm run messages`);
  process.exit(1);
}
