import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import type { Value } from "../contract";
import { number } from "../format";

/** A cell is text, or a number that is shown to four digits and kept to all of them. */
export type Cell = string | Value | undefined | boolean;

export interface Numbers {
  caption: string;
  columns: string[];
  rows: Cell[][];
}

function Data({ cell }: { cell: Cell }) {
  if (typeof cell === "string") return <td>{cell || "–"}</td>;
  if (typeof cell === "boolean") return <td>{cell ? "yes" : "no"}</td>;
  return <td class="n" data-value={cell ?? "null"}>{number(cell)}</td>;
}

export function Table({ caption, columns, rows, shown = false }: Numbers & { shown?: boolean }) {
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={caption}>
      <table>
        <caption class={shown ? "" : "unseen"}>{caption}</caption>
        <thead><tr>{columns.map((column) => <th scope="col" key={column}>{column}</th>)}</tr></thead>
        <tbody>{rows.map((row, i) => <tr key={i}>{row.map((cell, j) => <Data key={j} cell={cell} />)}</tr>)}</tbody>
      </table>
    </div>
  );
}

interface PanelProperties {
  id: string;
  title: string;
  what: ComponentChildren; // one sentence: what it shows
  size?: "third" | "half" | "tall" | "wide" | "full";
  numbers?: () => Numbers[]; // the same, to be read
  empty?: string | false; // why there is nothing to see yet
  aside?: ComponentChildren; // beside the title
  children?: ComponentChildren;
}

/** A panel: its title, what it shows in one sentence, the picture, and on demand the numbers behind it. */
export function Panel({ id, title, what, size = "half", numbers, empty, aside, children }: PanelProperties) {
  const [open, setOpen] = useState(false);
  return (
    <section class={`panel ${size}`} id={id} aria-labelledby={`${id}-title`}>
      <header>
        <h3 id={`${id}-title`}>{title}</h3>
        {aside}
        {numbers && !empty && (
          <button class="quiet" aria-expanded={open} aria-label={`${title}: numbers`} onClick={() => setOpen(!open)}>numbers</button>
        )}
      </header>
      <p class="what">{what}</p>
      {empty ? <p class="empty">{empty}</p> : children}
      {open && !empty && numbers && <div class="numbers">{numbers().map((one) => <Table key={one.caption} {...one} shown />)}</div>}
    </section>
  );
}

export function Choice<T extends string>({ name, options, value, choose }: {
  name: string; options: readonly T[]; value: T; choose: (option: T) => void;
}) {
  return (
    <div class="choice" role="group" aria-label={name}>
      {options.map((option) => (
        <button key={option} aria-pressed={option === value} onClick={() => choose(option)}>{option}</button>
      ))}
    </div>
  );
}

/** What a colour or a stroke stands for. */
export function Key({ items }: { items: [kind: string, label: string][] }) {
  return <ul class="key">{items.map(([kind, label]) => <li key={label}><i class={kind} />{label}</li>)}</ul>;
}
